import { useRef } from 'preact/hooks';
import { stateOf, type Reconstruction } from '../api/types';
import { bytes } from '../format';

interface Props {
  base: string; // address of the reconstruction
  reconstruction: Reconstruction;
  hasParts: boolean;
}

export function Downloads({ base, reconstruction, hasParts }: Props) {
  const details = useRef<HTMLDetailsElement>(null);
  const done = stateOf(reconstruction) === 'DONE';
  const close = () => details.current?.removeAttribute('open');
  const onKeyDown = (event: KeyboardEvent) => {
    if (event.key !== 'Escape' || !details.current?.open) return;
    close();
    details.current.querySelector('summary')?.focus();
  };
  if (!done && !hasParts) return null;
  const link = (href: string, file: string, title: string, note: string) => (
    <li>
      <a href={href} download={file} onClick={close}>
        <strong>{title}</strong>
        <span class="muted small">{note}</span>
      </a>
    </li>
  );
  const { id } = reconstruction;
  return (
    <details class="menu" ref={details} onKeyDown={onKeyDown}>
      <summary class={done ? 'button primary' : 'button'}>Download</summary>
      <ul>
        {done &&
          link(
            `${base}/mesh`,
            `${id}.ply`,
            'Mesh, PLY',
            `${bytes(Number(reconstruction.meshBytes ?? 0))}, all attributes`,
          )}
        {done && link(`${base}/mesh.glb`, `${id}.glb`, 'Mesh, GLB', 'binary glTF 2.0, for viewers')}
        {!done &&
          link(
            `${base}/mesh?partial=true`,
            `${id}-so-far.ply`,
            'Accepted so far, PLY',
            'parts side by side, not joined',
          )}
        {done &&
          link(
            `${base}/parts`,
            `${id}-parts.json`,
            'List of parts, JSON',
            'one surface per camera; see a camera for its PLY',
          )}
      </ul>
    </details>
  );
}
