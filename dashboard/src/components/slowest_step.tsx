// Cameras are committed in one order: the earliest camera in flight is the one that everything waits for.
import { useEffect, useState } from 'preact/hooks';
import { reconstructionUrl } from '../api/client';
import { DataService } from '../api/data_service';
import type { Attempt } from '../api/types';
import { duration } from '../format';

export function firstInOrder(attempts: readonly Attempt[]): Attempt | null {
  let first: Attempt | null = null;
  for (const attempt of attempts) {
    if (attempt.outcome !== 'ATTEMPT_OUTCOME_RUNNING') continue;
    if (first === null || attempt.sequence < first.sequence) first = attempt;
  }
  return first;
}

export function SlowestStepWords({ attempt, name, now }: { attempt: Attempt; name?: string; now: number }) {
  const seconds = Math.max(0, (now - Date.parse(attempt.startTime)) / 1000);
  return (
    <span>
      Next commit waits for <strong>{name ?? `camera ${attempt.camera}`}</strong> at <strong>{attempt.worker}</strong>,{' '}
      {duration(seconds)} so far
    </span>
  );
}

// One thread for all rows of the list.
let shared: DataService | null = null;

export function SlowestStep({ id, now }: { id: string; now: number }) {
  const [attempt, setAttempt] = useState<Attempt | null>(null);
  useEffect(() => {
    let closed = false;
    const refresh = async () => {
      shared ??= new DataService();
      const url = reconstructionUrl(id, '/attempts');
      const running = await shared.ask({ kind: 'attempts', url, running: true }).catch(() => []);
      if (!closed) setAttempt(firstInOrder(running));
    };
    void refresh();
    const timer = setInterval(() => void refresh(), 4000);
    return () => {
      closed = true;
      clearInterval(timer);
    };
  }, [id]);
  return attempt === null ? null : <SlowestStepWords attempt={attempt} now={now} />;
}
