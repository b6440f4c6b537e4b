// SPDX-License-Identifier: Apache-2.0
// The mesh in 3D as it grows, and what can be done with the view.
import { useSignalEffect } from '@preact/signals';
import type { RefObject } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { api, reconstructionUrl } from '../api/client';
import { CAMERA_STATES, isOver, stateOf } from '../api/types';
import { count, counted } from '../format';
import type { ReconstructionStore } from '../state/reconstruction_store';
import { cssColor, theme } from '../theme';
import { untilLoaded } from '../until_loaded';
import type { Coloring } from '../view3d/part_buffer';
import { nextBudget } from '../view3d/level_of_detail';
import { PartLoader } from '../view3d/part_loader';
import type { PhotoPlace } from '../view3d/photo_place';
import type { Region } from '../view3d/region';
import type { SceneViewer } from '../view3d/scene_viewer';
import type { TileLayer } from '../view3d/tile_layer';
import { CropBox } from './crop_box';
import { Notice, Segmented } from './pieces';

const COLORINGS = [
  ['photo', 'Photographs'],
  ['camera', 'Cameras'],
  ['plain', 'Shape'],
] as const;

const STATE_WORDS = ['waiting', 'under way', 'processed', 'committed', 'skipped'] as const;

// A phone has less memory, and fewer pixels to see them with.
const LARGEST_BUDGET = window.matchMedia('(max-width: 700px), (pointer: coarse)').matches ? 400_000 : 1_500_000;
const SOFTWARE_BUDGET = 60_000;
const FRAMES_TO_JUDGE = 5;

interface Props {
  store: ReconstructionStore;
  selected: number;
  onSelect: (camera: number) => void;
}

interface ViewerNumbers {
  parts: number;
  faces: number;
  shown: number;
  tiles: number; // of the one mesh, when it is what is seen
  complete: boolean;
  region: Region | null; // that the surface fills
}

interface LaidPhoto {
  camera: number;
  place: PhotoPlace;
}

interface Measured {
  points: number;
  distance: number | null;
}

// The 3D view on a canvas, fed from the store: null until three.js is there. `failure` says why there is none.
function useViewer(canvas: RefObject<HTMLCanvasElement>, { store, selected, onSelect }: Props) {
  const [viewer, setViewer] = useState<SceneViewer | null>(null);
  const [loader, setLoader] = useState<PartLoader | null>(null);
  const [failure, setFailure] = useState('');
  const rest = useRef(() => {});
  const frameTook = useRef((_milliseconds: number) => {});
  const [photo, setPhoto] = useState<LaidPhoto | null>(null);
  const [measured, setMeasured] = useState<Measured>({ points: 0, distance: null });
  const [numbers, setNumbers] = useState<ViewerNumbers>({
    parts: 0,
    faces: 0,
    shown: 0,
    tiles: 0,
    complete: false,
    region: null,
  });

  useEffect(() => {
    let closed = false;
    let close = () => {};
    // three.js is large; the rest of the page does not wait for it.
    void untilLoaded(() => import('../view3d/scene_viewer')).then(({ SceneViewer }) => {
      if (closed) return;
      try {
        close = open(
          new SceneViewer(canvas.current!, {
            onPick: onSelect,
            onRest: () => rest.current(),
            onFrame: (milliseconds) => frameTook.current(milliseconds),
            onLookThrough: (camera, place) => setPhoto(place === null ? null : { camera, place }),
            onMeasure: (points, distance) => setMeasured({ points, distance }),
          }),
        );
      } catch {
        setFailure('This browser does not offer WebGL 2; everything but the 3D view works.');
      }
    });
    return () => {
      closed = true;
      close();
    };
  }, [store]);

  const open = (made: SceneViewer) => {
    let budget = made.inSoftware ? SOFTWARE_BUDGET : LARGEST_BUDGET;
    const loading = new PartLoader(
      {
        data: store.data,
        urlOf: (sequence, maxFaces) => reconstructionUrl(store.id, `/parts/${sequence}/preview?max_faces=${maxFaces}`),
        show: (part, geometry) => made.show(part, geometry),
        importanceOf: (part) => made.importanceOf(part),
      },
      budget,
    );
    rest.current = () => loading.plan();
    let times: number[] = [];
    frameTook.current = (milliseconds) => {
      times.push(milliseconds);
      if (times.length < FRAMES_TO_JUDGE) return;
      const median = times.sort((a, b) => a - b)[FRAMES_TO_JUDGE >> 1]!;
      times = [];
      budget = nextBudget(budget, LARGEST_BUDGET, median, made.shownFaces);
      loading.setBudget(budget);
      made.setTileBudget(budget);
    };
    made.setTileBudget(budget);
    setViewer(made);
    setLoader(loading);
    const counting = setInterval(() => {
      setNumbers({
        parts: loading.parts.size,
        faces: loading.facesOfWhole,
        shown: made.shownFaces,
        tiles: made.shownTiles,
        complete: loading.complete && made.upToDate,
        region: made.surfaceRegion,
      });
    }, 250);
    return () => {
      clearInterval(counting);
      loading.close();
      made.dispose();
    };
  };

  useSignalEffect(() => {
    const table = store.cameras.value;
    if (table !== null) viewer?.setCameras(table);
  });
  useSignalEffect(() => {
    if (store.parts.value.length > 0) loader?.add(store.parts.value);
  });
  useEffect(() => {
    if (viewer === null) return;
    if (store.cameras.value !== null) viewer.setCameras(store.cameras.value);
    loader?.add(store.parts.value);
  }, [viewer, loader]);
  const done = store.reconstruction.value !== null && stateOf(store.reconstruction.value) === 'DONE';
  useEffect(() => (viewer !== null && done ? showMesh(viewer, store.id) : undefined), [viewer, done]);
  useEffect(() => viewer?.setBackground(cssColor('--stage')), [viewer, theme.value]);
  useEffect(() => viewer?.select(selected), [viewer, selected, store.cameras.value]);
  return { viewer, failure, numbers, photo, measured };
}

// The one mesh takes the place of the surfaces when its first tiles are there; where it cannot be had they stay. The
// answer ends it.
function showMesh(viewer: SceneViewer, id: string): () => void {
  let closed = false;
  let layer: TileLayer | null = null;
  const close = () => {
    closed = true;
    if (layer === null) return;
    viewer.showTiles(null);
    layer.dispose();
    layer = null;
  };
  void Promise.all([untilLoaded(() => import('../view3d/tile_layer')), api.offset(id)])
    .then(([{ TileLayer }, offset]) => {
      if (closed) return;
      layer = new TileLayer(reconstructionUrl(id, '/tiles/tileset.json'), offset);
      viewer.showTiles(layer);
    })
    .catch(() => {});
  return close;
}

const inPixels = ({ left, top, width, height }: PhotoPlace) => ({
  left: `${left}px`,
  top: `${top}px`,
  width: `${width}px`,
  height: `${height}px`,
});

function measuredWords({ points, distance }: Measured): string {
  if (distance !== null) return `${Number(distance.toPrecision(4))} units of the scene`;
  return points === 0 ? 'Click a point of the surface' : 'Click another one';
}

export function ViewerPanel(props: Props) {
  const { store, selected } = props;
  const canvas = useRef<HTMLCanvasElement>(null);
  const frame = useRef<HTMLDivElement>(null);
  const { viewer, failure, numbers, photo, measured } = useViewer(canvas, props);
  const [coloring, setColoring] = useState<Coloring>('photo');
  const [frusta, setFrusta] = useState(true);
  const [measuring, setMeasuring] = useState(false);
  const [cropping, setCropping] = useState(false);
  const [opacity, setOpacity] = useState(60);
  useEffect(() => viewer?.setColoring(coloring), [viewer, coloring]);
  useEffect(() => viewer?.showFrusta(frusta), [viewer, frusta]);
  useEffect(() => viewer?.setMeasuring(measuring), [viewer, measuring]);

  const onKeyDown = (event: KeyboardEvent) => {
    if (viewer === null || event.ctrlKey || event.metaKey || event.altKey) return;
    const turn = Math.PI / 24;
    const moves: Record<string, () => void> = {
      ArrowLeft: () => viewer.orbit(-turn, 0, 1),
      ArrowRight: () => viewer.orbit(turn, 0, 1),
      ArrowUp: () => viewer.orbit(0, -turn, 1),
      ArrowDown: () => viewer.orbit(0, turn, 1),
      '+': () => viewer.orbit(0, 0, 0.85),
      '=': () => viewer.orbit(0, 0, 0.85),
      '-': () => viewer.orbit(0, 0, 1 / 0.85),
      f: () => viewer.fit(),
      c: () => setFrusta((shown) => !shown),
      m: () => setMeasuring((on) => !on),
    };
    const move = moves[event.key];
    if (move === undefined) return;
    event.preventDefault();
    move();
  };

  const state = store.reconstruction.value === null ? null : stateOf(store.reconstruction.value);
  const words =
    numbers.parts === 0
      ? state !== null && isOver(state)
        ? 'Nothing was accepted'
        : 'No surface is accepted yet'
      : numbers.tiles > 0
        ? `The mesh: ${count(Number(store.reconstruction.value?.progress?.faces ?? 0))} triangles` +
          `, ${count(numbers.shown)} shown`
        : `Surfaces of ${counted(numbers.parts, 'camera')}, side by side: ${count(numbers.faces)} triangles` +
        (numbers.shown < numbers.faces ? `, ${count(numbers.shown)} shown` : '');
  return (
    <section class="card stage" ref={frame} aria-label="The mesh in 3D">
      <canvas
        ref={canvas}
        tabIndex={0}
        role="application"
        aria-label={`The mesh in 3D: ${words}. Arrow keys turn, plus and minus zoom, F shows everything, C shows or hides cameras, M measures.`}
        onKeyDown={onKeyDown}
      />
      {photo !== null && (
        <img
          class="stage-photo"
          style={{ ...inPixels(photo.place), opacity: opacity / 100 }}
          src={reconstructionUrl(store.id, `/cameras/${photo.camera}/photo?width=1280`)}
          alt=""
        />
      )}
      {failure !== '' && (
        <div class="stage-failure">
          <Notice tone="warning">{failure}</Notice>
        </div>
      )}
      <div class="stage-top">
        <Segmented label="Colour by" value={coloring} options={COLORINGS} onChange={setColoring} />
        <div class="stage-buttons">
          <button
            class="button small"
            aria-pressed={frusta}
            onClick={() => setFrusta(!frusta)}
            title="Show or hide cameras (C)"
          >
            Frusta
          </button>
          <button class="button small" onClick={() => viewer?.fit()} title="Show everything (F)">
            Fit
          </button>
          <button
            class="button small"
            disabled={selected < 0}
            onClick={() => viewer?.lookThrough(selected)}
            title={
              selected < 0
                ? 'Select a camera first: in the list, or its pyramid here'
                : 'Look from where the selected camera stood, its photograph laid over'
            }
          >
            Look through
          </button>
          <button
            class="button small"
            aria-pressed={measuring}
            onClick={() => setMeasuring(!measuring)}
            title="Measure between two points of the surface (M)"
          >
            Measure
          </button>
          <button
            class="button small"
            aria-pressed={cropping}
            disabled={numbers.parts === 0}
            onClick={() => setCropping(!cropping)}
            title={
              numbers.parts === 0 ? 'There is no surface yet' : 'Choose a box, and reconstruct what is in it alone'
            }
          >
            Crop
          </button>
          <button
            class="button small wide-only"
            onClick={() =>
              document.fullscreenElement ? document.exitFullscreen() : frame.current?.requestFullscreen()
            }
          >
            Full screen
          </button>
        </div>
      </div>
      {cropping && viewer !== null && numbers.region !== null && (
        <CropBox id={store.id} viewer={viewer} bounds={numbers.region} />
      )}
      <div class="stage-bottom">
        {photo !== null && (
          <label class="stage-tool">
            Photograph
            <input
              type="range"
              min="0"
              max="100"
              value={opacity}
              onInput={(event) => setOpacity(Number(event.currentTarget.value))}
            />
          </label>
        )}
        {measuring && (
          <output class="stage-tool" data-distance={measured.distance ?? ''}>
            {measuredWords(measured)}
          </output>
        )}
        <output
          class="stage-numbers"
          data-parts={numbers.parts}
          data-faces={numbers.faces}
          data-shown={numbers.shown}
          data-tiles={numbers.tiles}
          data-complete={numbers.complete}
          aria-live="off"
        >
          {words}
        </output>
        {frusta && (
          <ul class="legend" aria-label="Colours of cameras">
            {CAMERA_STATES.map((name, i) => (
              <li key={name}>
                <span class="dot" style={{ background: `var(--state-${name.toLowerCase().replace('_', '-')})` }} />
                {STATE_WORDS[i]}
              </li>
            ))}
          </ul>
        )}
      </div>
    </section>
  );
}
