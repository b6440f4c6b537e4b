// SPDX-License-Identifier: Apache-2.0
import { useState } from 'preact/hooks';
import { api } from '../api/client';
import type { Worker } from '../api/types';
import { useNow, usePolled } from '../components/hooks';
import { Confirm, Notice, PageTitle } from '../components/pieces';
import { ago, bytes, count, duration } from '../format';
import { linkTo } from '../router';

const POLL_MS = 2500;
// Longer silence than any heartbeat explains.
const SILENT_MS = 30_000;

function WorkerState({ worker, now }: { worker: Worker; now: number }) {
  if (now - Date.parse(worker.lastSeen ?? '') > SILENT_MS) return <span class="badge danger">Silent</span>;
  if (worker.draining) return <span class="badge warning">Drained</span>;
  return (worker.jobs ?? 0) > 0 ? (
    <span class="badge info live">Working</span>
  ) : (
    <span class="badge success">Idle</span>
  );
}

function WorkerCard(props: { worker: Worker; now: number; onDrain: () => void }) {
  const { worker, now } = props;
  const running = worker.running ?? [];
  return (
    <li class="card worker">
      <div class="worker-head">
        <h2>{worker.id}</h2>
        {worker.version && <span class="muted small">{worker.version}</span>}
        <WorkerState worker={worker} now={now} />
        <button class="button small end" onClick={props.onDrain} disabled={worker.draining}>
          Drain<span class="visually-hidden"> {worker.id}</span>
        </button>
      </div>
      <dl class="facts">
        <div>
          <dt>Cores</dt>
          <dd>{worker.cores ?? 0}</dd>
        </div>
        <div>
          <dt>Memory</dt>
          <dd>{bytes(Number(worker.memoryBytes ?? 0))}</dd>
        </div>
        <div>
          <dt>Leases</dt>
          <dd>{worker.jobs ?? 0}</dd>
        </div>
        <div>
          <dt>Last heartbeat</dt>
          <dd>{ago(worker.lastSeen, now)}</dd>
        </div>
      </dl>
      {running.length > 0 && (
        <ul class="held small" aria-label={`What ${worker.id} does now`}>
          {running.map((one) => (
            <li key={`${one.reconstructionId}/${one.sequence}`}>
              <span>
                {one.camera < 0 ? 'cameras' : `camera ${one.camera}`} of{' '}
                <a href={linkTo.reconstruction(one.reconstructionId)}>{one.reconstructionId}</a>
              </span>
              <span class="muted">{duration(Math.max(0, (now - Date.parse(one.beginTime)) / 1000))}</span>
            </li>
          ))}
        </ul>
      )}
    </li>
  );
}

export default function WorkersPage() {
  const [draining, setDraining] = useState<Worker | null>(null);
  const [failure, setFailure] = useState('');
  const { value, error, refresh } = usePolled(() => api.workers(), POLL_MS);
  const now = useNow();
  const answered = async (yes: boolean) => {
    setDraining(null);
    if (!yes || draining === null) return;
    try {
      await api.drain(draining.id);
      setFailure('');
    } catch (problem) {
      setFailure((problem as Error).message);
    }
    refresh();
  };
  const workers = value ?? [];
  const cores = workers.reduce((sum, worker) => sum + (worker.cores ?? 0), 0);
  const busy = workers.reduce((sum, worker) => sum + (worker.jobs ?? 0), 0);
  return (
    <>
      <div class="page-head">
        <PageTitle title="Workers" />
        {workers.length > 0 && (
          <span class="muted">
            {count(workers.length)} with {count(cores)} cores, {count(busy)} cameras under way
          </span>
        )}
      </div>
      {error !== null && <Notice tone="danger">{error.message}. Trying again …</Notice>}
      {failure !== '' && <Notice tone="danger">{failure}</Notice>}
      {value !== null && workers.length === 0 && (
        <div class="card empty">
          <h2>No worker has come yet</h2>
          <p>
            Start one on any machine that reaches this coordinator:{' '}
            <code class="mono">meshwright-worker --coordinator HOST:7420</code>
          </p>
        </div>
      )}
      <ul class="worker-grid">
        {workers.map((worker) => (
          <WorkerCard key={worker.id} worker={worker} now={now} onDrain={() => setDraining(worker)} />
        ))}
      </ul>
      {draining !== null && (
        <Confirm
          title={`Drain ${draining.id}?`}
          words="It gets no more cameras, finishes those it has, and stays idle until it is started again."
          action="Drain it"
          onAnswer={(yes) => void answered(yes)}
        />
      )}
    </>
  );
}
