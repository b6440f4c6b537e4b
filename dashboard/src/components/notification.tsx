// SPDX-License-Identifier: Apache-2.0
// Word from the browser when a reconstruction ends, for those who look at something else meanwhile.
import { signal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { isOver, type ReconstructionState } from '../api/types';

const wanted = signal(false); // of all reconstructions whose page is open

export function NotifyButton() {
  if (!('Notification' in window)) return null;
  const denied = Notification.permission === 'denied';
  const toggle = async () => {
    wanted.value = !wanted.value && (await Notification.requestPermission()) === 'granted';
  };
  return (
    <button
      class="button"
      aria-pressed={wanted.value}
      disabled={denied}
      title={denied ? 'This browser does not let the page notify you' : 'Word from the browser when it ends'}
      onClick={() => void toggle()}
    >
      {wanted.value ? 'Will notify' : 'Notify me'}
    </button>
  );
}

export function useNotification(id: string, state: ReconstructionState | null) {
  const before = useRef<ReconstructionState | null>(null);
  useEffect(() => {
    const ran = before.current !== null && !isOver(before.current);
    before.current = state;
    if (!ran || state === null || !isOver(state) || !wanted.value) return;
    new Notification(`${id}: ${state.toLowerCase()}`, { tag: id });
  }, [id, state]);
}
