// SPDX-License-Identifier: Apache-2.0
import { useRef, useState } from 'preact/hooks';
import { api } from '../api/client';
import { stateOf, type Format, type Reconstruction } from '../api/types';
import { bytes } from '../format';

interface Props {
  base: string; // address of the reconstruction
  reconstruction: Reconstruction;
  hasParts: boolean;
}

export function Downloads({ base, reconstruction, hasParts }: Props) {
  const details = useRef<HTMLDetailsElement>(null);
  const done = stateOf(reconstruction) === 'DONE';
  // As the coordinator's programs write them; asked for when the menu opens.
  const [formats, setFormats] = useState<Format[]>([]);
  const [failure, setFailure] = useState('');
  const onToggle = () => {
    if (details.current?.open && formats.length === 0) {
      api.formats().then(setFormats, (error: Error) => setFailure(`Formats cannot be shown: ${error.message}`));
    }
  };
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
    <details class="menu" ref={details} onKeyDown={onKeyDown} onToggle={onToggle}>
      <summary class={done ? 'button primary' : 'button'}>Download</summary>
      <ul>
        {failure !== '' && <li class="muted small">{failure}</li>}
        {done &&
          formats.some(({ name }) => name === 'glb') &&
          link(
            `${base}/mesh?format=glb&texture=true`,
            `${id}-textured.glb`,
            'Mesh with a texture, GLB',
            'few triangles, cut from the photographs; made when asked for, which may take minutes',
          )}
        {done &&
          formats.map(({ name, ending, title, note }) =>
            link(
              name === 'ply' ? `${base}/mesh` : `${base}/mesh?format=${name}`,
              `${id}${ending}`,
              `Mesh, ${title}`,
              name === 'ply' ? `${bytes(Number(reconstruction.meshBytes ?? 0))}, ${note}` : note,
            ),
          )}
        {!done &&
          link(
            `${base}/mesh?partial=true`,
            `${id}-so-far.ply`,
            'Accepted so far, PLY',
            'parts side by side, not joined',
          )}
        {done && (
          <li>
            <a href={`${base}/report`} target="_blank" rel="noopener" onClick={close}>
              <strong>Report, a page</strong>
              <span class="muted small">what of each photograph the mesh shows, where rays were lost, times</span>
            </a>
          </li>
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
