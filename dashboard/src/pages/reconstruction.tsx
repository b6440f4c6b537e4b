// SPDX-License-Identifier: Apache-2.0
import { useEffect, useState } from 'preact/hooks';
import { api, reconstructionUrl } from '../api/client';
import { isOver, stateOf, type Reconstruction } from '../api/types';
import { IncidenceCard } from '../charts/incidence';
import { SharesCard } from '../charts/shares';
import { TimelineCard } from '../charts/timeline';
import { CameraPanel } from '../components/camera_panel';
import { Downloads } from '../components/downloads';
import { useNow } from '../components/hooks';
import { LogCard } from '../components/log';
import { NotifyButton, useNotification } from '../components/notification';
import { Confirm, Notice, PageTitle, ProgressBar, StateBadge } from '../components/pieces';
import { VerdictBar } from '../components/verdict_bar';
import { SlowestStepWords } from '../components/slowest_step';
import { ViewerPanel } from '../components/viewer_panel';
import { capitalized, count, duration, percent } from '../format';
import { linkTo } from '../router';
import { secondsLeft } from '../state/eta';
import { ReconstructionStore } from '../state/reconstruction_store';
import '../styles/reconstruction.css';

function Fact({ name, value, title }: { name: string; value: string; title?: string }) {
  return (
    <div title={title}>
      <dt>{name}</dt>
      <dd>{value}</dd>
    </div>
  );
}

function Summary({ store, reconstruction }: { store: ReconstructionStore; reconstruction: Reconstruction }) {
  const now = useNow();
  const state = stateOf(reconstruction);
  const progress = reconstruction.progress ?? {};
  const total = progress.camerasTotal ?? 0;
  const start = Date.parse(reconstruction.createTime ?? '') || now;
  const end = isOver(state) ? Date.parse(reconstruction.finishTime ?? '') || now : now;
  const left = secondsLeft(reconstruction, now);
  const filtered = Number(progress.patchesFiltered ?? 0);
  const first = state === 'RUNNING' ? store.firstHeld() : null;
  const name = first === null ? undefined : store.cameras.value?.names[first.camera];
  return (
    <section class="card summary" aria-label="Progress">
      <ProgressBar progress={progress} label={state === 'JOINING' ? 'Mesh joined' : 'Cameras committed'} state={state} />
      <dl class="facts">
        <Fact name="Cameras" value={`${count(progress.camerasCommitted ?? 0)} of ${count(total)}`} />
        {!isOver(state) && (
          <Fact name="In flight" value={count(progress.camerasInFlight ?? 0)} title="Chosen and not yet committed" />
        )}
        {(progress.camerasSkipped ?? 0) > 0 && (
          <Fact name="Skipped" value={count(progress.camerasSkipped!)} title="Given up after repeated failures" />
        )}
        <Fact
          name="Accepted"
          value={filtered > 0 ? percent(Number(progress.patchesAccepted ?? 0) / filtered) : '–'}
          title="Patches that other cameras confirm, of those that filtering left"
        />
        {Number(progress.faces ?? 0) > 0 && (
          <Fact
            name="Mesh"
            value={`${count(Number(progress.faces))} triangles`}
            title="Of the one mesh that the surfaces were joined into: what overlapped is there once"
          />
        )}
        <Fact name={isOver(state) ? 'Took' : 'Running for'} value={duration(Math.max(0, (end - start) / 1000))} />
        {left !== null && <Fact name="Left" value={`about ${duration(left)}`} title="Until the mesh is there" />}
      </dl>
      {reconstruction.verdict !== undefined && <VerdictBar verdict={reconstruction.verdict} />}
      {first !== null && (
        <p class="muted small">
          <SlowestStepWords held={first} name={name} now={now} />
        </p>
      )}
    </section>
  );
}

function Connection({ store }: { store: ReconstructionStore }) {
  const state = store.connection.value;
  const reconstruction = store.reconstruction.value;
  if (reconstruction === null || isOver(stateOf(reconstruction)) || state === 'live') return null;
  return <span class="badge warning live">Reconnecting</span>;
}

export default function ReconstructionPage({ id }: { id: string }) {
  const [store, setStore] = useState<ReconstructionStore | null>(null);
  const [selected, setSelected] = useState(-1);
  const [cancelling, setCancelling] = useState(false);
  const [deleting, setDeleting] = useState(false);
  const [failure, setFailure] = useState('');
  useEffect(() => {
    const made = new ReconstructionStore(id);
    setStore(made);
    return () => made.close();
  }, [id]);

  const reconstruction = store?.reconstruction.value ?? null;
  const state = reconstruction === null ? null : stateOf(reconstruction);
  useNotification(id, state);
  const cancelAnswered = async (yes: boolean) => {
    setCancelling(false);
    if (!yes || store === null) return;
    try {
      await store.cancel();
      setFailure('');
    } catch (problem) {
      setFailure((problem as Error).message);
    }
  };

  const deleteAnswered = async (yes: boolean) => {
    setDeleting(false);
    if (!yes) return;
    try {
      await api.remove(id);
      location.hash = linkTo.reconstructions;
    } catch (problem) {
      setFailure((problem as Error).message);
    }
  };

  return (
    <>
      <div class="page-head">
        <span class="crumb">
          <a href={linkTo.reconstructions}>Reconstructions</a>
        </span>
        <PageTitle title={id} />
        {state !== null && <StateBadge state={state} />}
        {store !== null && <Connection store={store} />}
        <div class="actions">
          {reconstruction !== null && (
            <Downloads
              base={reconstructionUrl(id)}
              reconstruction={reconstruction}
              hasParts={store!.parts.value.length > 0}
            />
          )}
          {state !== null && !isOver(state) && (
            <button class="button danger" onClick={() => setCancelling(true)}>
              Cancel
            </button>
          )}
          {state !== null && !isOver(state) && <NotifyButton />}
          {state !== null && state !== 'CREATED' && (
            <a class="button" href={linkTo.again(id)} title="The same photographs with other options">
              Again …
            </a>
          )}
          {state !== null && isOver(state) && (
            <button class="button danger" onClick={() => setDeleting(true)}>
              Delete
            </button>
          )}
        </div>
      </div>
      {store?.missing.value && <Notice tone="danger">There is no reconstruction “{id}” here.</Notice>}
      {failure !== '' && <Notice tone="danger">{failure}</Notice>}
      {(reconstruction?.stage ?? '') !== '' && <Notice>{reconstruction!.stage}</Notice>}
      {(reconstruction?.warnings ?? []).map((warning) => (
        <Notice key={warning} tone="warning">
          {warning}
        </Notice>
      ))}
      {(reconstruction?.verdict?.warning ?? '') !== '' && (
        <Notice tone="warning">{capitalized(reconstruction!.verdict!.warning!)}.</Notice>
      )}
      {state === 'FAILED' && <Notice tone="danger">It failed: {reconstruction!.failure}</Notice>}
      {store !== null && !store.missing.value && (
        <div class="reconstruction">
          {reconstruction !== null && <Summary store={store} reconstruction={reconstruction} />}
          <div class="stage-and-camera">
            <ViewerPanel store={store} selected={selected} onSelect={setSelected} />
            <CameraPanel store={store} selected={selected} onSelect={setSelected} />
          </div>
          <SharesCard store={store} onSelect={setSelected} />
          <TimelineCard store={store} onSelect={setSelected} />
          <div class="two">
            <IncidenceCard store={store} onSelect={setSelected} />
            <LogCard store={store} onSelect={setSelected} />
          </div>
        </div>
      )}
      {cancelling && (
        <Confirm
          title={`Cancel ${id}?`}
          words="What is accepted so far stays and can be downloaded; it cannot be taken up again."
          action="Cancel it"
          onAnswer={(yes) => void cancelAnswered(yes)}
        />
      )}
      {deleting && (
        <Confirm
          title={`Delete ${id}?`}
          words="Its mesh, its surfaces and the photographs that nobody else uses are removed for good."
          action="Delete it"
          onAnswer={(yes) => void deleteAnswered(yes)}
        />
      )}
    </>
  );
}
