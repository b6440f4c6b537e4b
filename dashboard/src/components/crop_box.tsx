// SPDX-License-Identifier: Apache-2.0
// A box over the surface: as region.json, or for another reconstruction of what is in it alone.
import { useEffect, useState } from 'preact/hooks';
import { api } from '../api/client';
import { linkTo } from '../router';
import { moveSide, regionJson, type Region } from '../view3d/region';
import type { SceneViewer } from '../view3d/scene_viewer';

const AXES = ['x', 'y', 'z'] as const;
const STEPS = 200;

interface Props {
  id: string;
  viewer: SceneViewer;
  bounds: Region; // what the surface fills, which may grow meanwhile
}

export function CropBox({ id, viewer, bounds }: Props) {
  // A side that nobody moved stays where the surface ends.
  const [moved, setMoved] = useState<(number | null)[]>([null, null, null, null, null, null]);
  const region = bounds.map((bound, side) => moved[side] ?? bound) as Region;
  const [failure, setFailure] = useState('');
  useEffect(() => {
    viewer.showRegion(region);
    return () => viewer.showRegion(null);
  }, [viewer, ...region]);

  // In the coordinates of the scene, which may lie far from those that are drawn.
  const told = async (use: (json: string) => void) => {
    try {
      use(regionJson(region, await api.offset(id)));
    } catch (error) {
      setFailure((error as Error).message);
    }
  };
  const download = (json: string) => {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([`${json}\n`], { type: 'application/json' }));
    link.download = 'region.json';
    link.click();
    URL.revokeObjectURL(link.href);
  };
  const slider = (axis: number, side: number) => (
    <input
      type="range"
      aria-label={`${side < 3 ? 'Least' : 'Greatest'} ${AXES[axis]}`}
      min={bounds[axis]}
      max={bounds[axis + 3]}
      step={(bounds[axis + 3]! - bounds[axis]!) / STEPS || 1}
      value={region[side]}
      onInput={(event) => {
        const value = moveSide(region, side, Number(event.currentTarget.value), bounds)[side]!;
        setMoved(moved.map((before, i) => (i === side ? value : before)));
      }}
    />
  );
  return (
    <section class="crop-box" aria-label="Crop box">
      <fieldset>
        {AXES.map((name, axis) => (
          <>
            <span>{`${name}: ${Number(region[axis]!.toPrecision(4))} to ${Number(region[axis + 3]!.toPrecision(4))}`}</span>
            <span />
            {slider(axis, axis)}
            {slider(axis, axis + 3)}
          </>
        ))}
      </fieldset>
      <button
        class="button small primary"
        onClick={() => void told((json) => (location.hash = linkTo.again(id, JSON.parse(json) as Region)))}
      >
        Again, this box alone
      </button>
      <button class="button small" onClick={() => void told(download)}>
        Download region.json
      </button>
      {failure !== '' && <p role="alert">{failure}</p>}
    </section>
  );
}
