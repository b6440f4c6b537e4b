// SPDX-License-Identifier: Apache-2.0
// Who holds up the others.
import { useEffect, useState } from 'preact/hooks';
import { reconstructionUrl } from '../api/client';
import { DataService } from '../api/data_service';
import type { Attempt } from '../api/types';
import { duration } from '../format';
import { firstInOrder } from '../state/order';

export function SlowestStepWords({ held, name, now }: { held: Attempt; name?: string; now: number }) {
  const seconds = Math.max(0, (now - Date.parse(held.beginTime)) / 1000);
  return (
    <span>
      Next commit waits for <strong>{name ?? `camera ${held.camera}`}</strong> at <strong>{held.worker}</strong>,{' '}
      {duration(seconds)} so far
    </span>
  );
}

// One thread for all rows of the list.
let shared: DataService | null = null;

export function SlowestStep({ id, now }: { id: string; now: number }) {
  const [held, setHeld] = useState<Attempt | null>(null);
  useEffect(() => {
    let closed = false;
    const refresh = async () => {
      shared ??= new DataService();
      const all = await shared.ask({ kind: 'held', url: reconstructionUrl(id) }).catch(() => []);
      if (!closed) setHeld(firstInOrder(all));
    };
    void refresh();
    const timer = setInterval(() => void refresh(), 4000);
    return () => {
      closed = true;
      clearInterval(timer);
    };
  }, [id]);
  return held === null ? null : <SlowestStepWords held={held} now={now} />;
}
