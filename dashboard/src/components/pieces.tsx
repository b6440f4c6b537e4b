// SPDX-License-Identifier: Apache-2.0
// Small things that all pages use.
import type { ComponentChildren } from 'preact';
import { useEffect, useId, useRef } from 'preact/hooks';
import type { Progress, ReconstructionState } from '../api/types';

const STATE_WORDS: Record<ReconstructionState, [words: string, tone: string]> = {
  CREATED: ['Waiting for files', ''],
  PREPARING: ['Preparing', 'info live'],
  RUNNING: ['Running', 'info live'],
  JOINING: ['Joining', 'info live'],
  DONE: ['Done', 'success'],
  FAILED: ['Failed', 'danger'],
  CANCELLED: ['Cancelled', ''],
};

export function StateBadge({ state }: { state: ReconstructionState }) {
  const [words, tone] = STATE_WORDS[state] ?? [state, ''];
  return <span class={`badge ${tone}`}>{words}</span>;
}

function JoiningBar({ share, label }: { share: number; label: string }) {
  const percents = Math.floor(100 * share);
  return (
    <div
      class="progress"
      role="progressbar"
      aria-label={label}
      aria-valuemin={0}
      aria-valuemax={100}
      aria-valuenow={percents}
      aria-valuetext={`${percents} % of the mesh joined`}
    >
      <span style={{ width: `${percents}%` }} />
    </div>
  );
}

// Cameras; once all are committed, the mesh.
export function ProgressBar(props: { progress: Progress | undefined; label: string; state: ReconstructionState }) {
  const { progress, label, state } = props;
  if (state === 'JOINING') return <JoiningBar share={progress?.joinedShare ?? 0} label={label} />;
  const total = progress?.camerasTotal ?? 0;
  const committed = progress?.camerasCommitted ?? 0;
  const inFlight = progress?.camerasInFlight ?? 0;
  const share = (cameras: number) => `${total > 0 ? Math.min(100, (100 * cameras) / total) : 0}%`;
  return (
    <div
      class="progress"
      role="progressbar"
      aria-label={label}
      aria-valuemin={0}
      aria-valuemax={Math.max(total, 1)}
      aria-valuenow={committed}
      aria-valuetext={`${committed} of ${total} cameras`}
    >
      <span class="flight" style={{ width: share(committed + inFlight) }} />
      <span style={{ width: share(committed) }} />
    </div>
  );
}

export function Card(props: {
  title: string;
  note?: ComponentChildren;
  class?: string;
  tools?: ComponentChildren;
  children: ComponentChildren;
}) {
  const id = useId();
  return (
    <section class={`card ${props.class ?? ''}`} aria-labelledby={id}>
      <header>
        <h2 id={id}>{props.title}</h2>
        {props.note !== undefined && <span class="note">{props.note}</span>}
        {props.tools}
      </header>
      <div class="body">{props.children}</div>
    </section>
  );
}

// Says itself to screen readers when it appears.
export function Notice({ tone = '', children }: { tone?: '' | 'danger' | 'warning'; children: ComponentChildren }) {
  return (
    <div class={`notice ${tone}`} role={tone === 'danger' ? 'alert' : 'status'}>
      {children}
    </div>
  );
}

export function Segmented<Value extends string>(props: {
  label: string;
  value: Value;
  options: readonly (readonly [Value, string])[];
  onChange: (value: Value) => void;
}) {
  const name = useId();
  return (
    <fieldset class="segmented">
      <legend class="visually-hidden">{props.label}</legend>
      {props.options.map(([value, words]) => (
        <label key={value}>
          <input
            type="radio"
            name={name}
            value={value}
            checked={value === props.value}
            onChange={() => props.onChange(value)}
          />
          {words}
        </label>
      ))}
    </fieldset>
  );
}

// A question before something that cannot be taken back.
export function Confirm(props: {
  title: string;
  words: ComponentChildren;
  action: string;
  onAnswer: (yes: boolean) => void;
}) {
  const dialog = useRef<HTMLDialogElement>(null);
  const title = useId();
  useEffect(() => dialog.current?.showModal(), []);
  return (
    <dialog ref={dialog} aria-labelledby={title} onClose={() => props.onAnswer(dialog.current?.returnValue === 'yes')}>
      <form method="dialog">
        <h2 id={title}>{props.title}</h2>
        <p class="muted">{props.words}</p>
        <div class="actions">
          <button class="button" value="no">
            Keep it
          </button>
          <button class="button danger" value="yes">
            {props.action}
          </button>
        </div>
      </form>
    </dialog>
  );
}

// The heading gets the focus when a page opens, so that screen readers say where one is.
export function PageTitle({ title, children }: { title: string; children?: ComponentChildren }) {
  const heading = useRef<HTMLHeadingElement>(null);
  useEffect(() => {
    document.title = `${title} · Meshwright`;
  }, [title]);
  useEffect(() => {
    if (location.hash !== '') heading.current?.focus({ preventScroll: true });
    window.scrollTo(0, 0);
  }, []);
  return (
    <h1 ref={heading} tabIndex={-1}>
      {children ?? title}
    </h1>
  );
}
