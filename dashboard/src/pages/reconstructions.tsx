// SPDX-License-Identifier: Apache-2.0
import { api } from '../api/client';
import { isOver, stateOf, type Reconstruction } from '../api/types';
import { useNow, usePolled } from '../components/hooks';
import { Notice, PageTitle, ProgressBar, StateBadge } from '../components/pieces';
import { SlowestStep } from '../components/slowest_step';
import { count, dateTime, duration, percent } from '../format';
import { linkTo } from '../router';
import { secondsLeft } from '../state/eta';

const POLL_MS = 2000;

function newestFirst(a: Reconstruction, b: Reconstruction): number {
  const over = Number(isOver(stateOf(a))) - Number(isOver(stateOf(b)));
  return over || (b.createTime ?? '').localeCompare(a.createTime ?? '') || a.id.localeCompare(b.id);
}

function Row({ reconstruction, now }: { reconstruction: Reconstruction; now: number }) {
  const state = stateOf(reconstruction);
  const progress = reconstruction.progress;
  const start = Date.parse(reconstruction.createTime ?? '') || now;
  const total = progress?.camerasTotal ?? 0;
  const left = secondsLeft(reconstruction, now);
  const finish = Date.parse(reconstruction.finishTime ?? '');
  return (
    <li class="card list-row">
      <div class="list-name">
        <a href={linkTo.reconstruction(reconstruction.id)}>{reconstruction.id}</a>
        <StateBadge state={state} />
        <span class="muted small">{dateTime(reconstruction.createTime)}</span>
      </div>
      <div class="list-progress">
        <ProgressBar progress={progress} label={`Progress of ${reconstruction.id}`} state={state} />
        <div class="muted small list-numbers">
          <span>
            {count(progress?.camerasCommitted ?? 0)} of {count(total)} cameras
            {(progress?.camerasSkipped ?? 0) > 0 && `, ${progress!.camerasSkipped} skipped`}
            {state === 'JOINING' && `, mesh joined ${percent(progress?.joinedShare ?? 0)}`}
          </span>
          {left !== null && <span>about {duration(left)} left</span>}
          {isOver(state) && finish > start && <span>took {duration((finish - start) / 1000)}</span>}
          {Number(progress?.faces ?? 0) > 0 && <span>{count(Number(progress!.faces))} triangles</span>}
        </div>
      </div>
      <div class="list-note small">
        {state === 'RUNNING' && <SlowestStep id={reconstruction.id} now={now} />}
        {state === 'FAILED' && <span class="danger-text">{reconstruction.failure}</span>}
      </div>
    </li>
  );
}

export function ReconstructionsPage() {
  const { value, error } = usePolled(async () => {
    const all = await api.listReconstructions();
    return all.sort(newestFirst);
  }, POLL_MS);
  const now = useNow();
  return (
    <>
      <div class="page-head">
        <PageTitle title="Reconstructions" />
        <div class="actions">
          <a class="button primary" href={linkTo.submit}>
            New reconstruction
          </a>
        </div>
      </div>
      {error !== null && <Notice tone="danger">{error.message}. Trying again …</Notice>}
      {value?.length === 0 && (
        <div class="card empty">
          <h2>Nothing has been reconstructed yet</h2>
          <p>Photographs with known cameras become a mesh here: a folder from COLMAP, Middlebury or Strecha.</p>
          <a class="button primary" href={linkTo.submit}>
            Submit a scene
          </a>
        </div>
      )}
      <ul class="list">
        {value?.map((reconstruction) => (
          <Row key={reconstruction.id} reconstruction={reconstruction} now={now} />
        ))}
      </ul>
    </>
  );
}
