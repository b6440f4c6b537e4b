// SPDX-License-Identifier: Apache-2.0
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import { api, ApiError, csrfHeader, errorOf, reconstructionUrl } from '../api/client';
import type { Option, Preset } from '../api/types';
import { Notice, PageTitle, Segmented } from '../components/pieces';
import { bytes, count, duration } from '../format';
import { linkTo } from '../router';
import { Digester } from '../upload/digest';
import { describeScene, idFrom, readChosen, readDropped, VALID_ID } from '../upload/scene_files';
import { Uploader, type FileToSend, type SendPart, type UploadProgress } from '../upload/uploader';
import '../styles/submit.css';

function sendPartTo(id: string): SendPart {
  return async ({ path, size, sha256, offset, partSha256, body }) => {
    const encoded = path.split('/').map(encodeURIComponent).join('/');
    const query = new URLSearchParams({ size: String(size), sha256, offset: String(offset), partSha256 });
    let response: Response;
    try {
      response = await fetch(reconstructionUrl(id, `/files/${encoded}?${query}`), {
        method: 'PUT',
        headers: { ...csrfHeader, 'Content-Type': 'application/octet-stream' },
        body,
      });
    } catch {
      throw new ApiError(0, 'The coordinator does not answer');
    }
    if (!response.ok) throw await errorOf(response);
    return Number(((await response.json()) as { offsetBytes: string }).offsetBytes);
  };
}

function DropZone({ onFiles }: { onFiles: (files: FileToSend[], name: string) => void }) {
  const [over, setOver] = useState(false);
  const folder = useRef<HTMLInputElement>(null);
  const files = useRef<HTMLInputElement>(null);
  useLayoutEffect(() => folder.current?.setAttribute('webkitdirectory', ''), []);
  const drop = async (event: DragEvent) => {
    event.preventDefault();
    setOver(false);
    const items = event.dataTransfer?.items;
    if (items === undefined) return;
    const entry = items[0]?.webkitGetAsEntry();
    const name = entry?.isDirectory ? entry.name : '';
    onFiles(await readDropped(items), name);
  };
  const chosen = (input: HTMLInputElement) => {
    if (input.files === null || input.files.length === 0) return;
    onFiles(readChosen(input.files), input.files[0]!.webkitRelativePath.split('/')[0] ?? '');
    input.value = '';
  };
  return (
    <div
      class={`drop ${over ? 'over' : ''}`}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => void drop(event)}
    >
      <p>
        <strong>Drop photographs here</strong>, or a scene’s folder: photographs together with their cameras
      </p>
      <p class="muted small">JPEG, PNG, PGM or PPM; cameras of COLMAP (text or binary), Middlebury or Strecha</p>
      <div class="drop-buttons">
        <button type="button" class="button" onClick={() => folder.current?.click()}>
          Choose a folder
        </button>
        <button type="button" class="button" onClick={() => files.current?.click()}>
          Choose files
        </button>
      </div>
      <input ref={folder} id="folder-input" type="file" hidden multiple onChange={(e) => chosen(e.currentTarget)} />
      <input ref={files} id="files-input" type="file" hidden multiple onChange={(e) => chosen(e.currentTarget)} />
    </div>
  );
}

function rangeOf(option: Option): string {
  const unit = option.unit === '' ? '' : ` ${option.unit}`;
  return `${option.minimum} to ${option.maximum}${unit}`;
}

function OptionField(props: { option: Option; value: string; onChange: (value: string) => void }) {
  const { option, value } = props;
  const id = `option-${option.name}`;
  return (
    <div class="option">
      <label for={id} class="mono">
        {option.name}
      </label>
      <input
        id={id}
        type="number"
        step={option.type === 'integer' ? 1 : 'any'}
        min={option.minimum}
        max={option.maximum}
        placeholder={String(option.default)}
        value={value}
        aria-describedby={`${id}-help`}
        onInput={(event) => props.onChange(event.currentTarget.value)}
      />
      <p id={`${id}-help`} class="muted small">
        {option.documentation}. {rangeOf(option)}, default {option.default}. {option.tradeOff}.
      </p>
    </div>
  );
}

function Options(props: {
  options: Option[];
  values: Record<string, string>;
  onChange: (name: string, value: string) => void;
}) {
  const groups = [...new Set(props.options.map((option) => option.group))];
  return (
    <>
      {groups.map((group, i) => {
        const mine = props.options.filter((option) => option.group === group);
        const changed = mine.filter((option) => (props.values[option.name] ?? '') !== '').length;
        return (
          <details key={group} class="option-group" open={i === 0}>
            <summary>
              {group}
              {changed > 0 && <span class="badge info">{changed} changed</span>}
            </summary>
            {mine.map((option) => (
              <OptionField
                key={option.name}
                option={option}
                value={props.values[option.name] ?? ''}
                onChange={(value) => props.onChange(option.name, value)}
              />
            ))}
          </details>
        );
      })}
    </>
  );
}

// The options as they are where nothing is said.
function withDefaults(options: Option[], preset: Preset | undefined): Option[] {
  return options.map((option) => ({ ...option, default: preset?.values[option.name] ?? option.default }));
}

function PresetField(props: { presets: Preset[]; value: string; onChange: (name: string) => void }) {
  const chosen = props.presets.find(({ name }) => name === props.value);
  return (
    <div class="preset">
      <Segmented
        label="Preset"
        value={props.value}
        options={props.presets.map(({ name }) => [name, name] as const)}
        onChange={props.onChange}
      />
      <p class="muted small">{chosen?.documentation}</p>
    </div>
  );
}

function UploadStatus({ progress, startMs }: { progress: UploadProgress; startMs: number }) {
  const share = progress.bytes > 0 ? progress.bytesDone / progress.bytes : 1;
  const seconds = (Date.now() - startMs) / 1000;
  const sent = progress.bytesDone - progress.bytesSkipped;
  const left = sent > 0 ? ((progress.bytes - progress.bytesDone) * seconds) / sent : null;
  return (
    <div class="card upload">
      <h2>Uploading</h2>
      <div
        class="progress"
        role="progressbar"
        aria-label="Upload"
        aria-valuemin={0}
        aria-valuemax={100}
        aria-valuenow={Math.floor(100 * share)}
      >
        <span style={{ width: `${100 * share}%` }} />
      </div>
      <p class="small">
        {bytes(progress.bytesDone)} of {bytes(progress.bytes)}, {count(progress.filesDone)} of {count(progress.files)}{' '}
        files
        {left !== null && left > 1 && `, about ${duration(left)} left`}
        {progress.bytesSkipped > 0 && `; ${bytes(progress.bytesSkipped)} were there already`}
      </p>
      <p class="small muted">{progress.current}</p>
      {progress.error !== '' && (
        <Notice tone="warning">
          {progress.error}; trying again in {duration(progress.retryInMs / 1000)}. Nothing that has arrived is lost.
        </Notice>
      )}
    </div>
  );
}

interface SceneFieldProps {
  files: FileToSend[];
  onFiles: (files: FileToSend[], name: string) => void;
  reference: string;
  onReference: (reference: string) => void;
  busy: boolean;
}

function SceneField({ files, onFiles, reference, onReference, busy }: SceneFieldProps) {
  const summary = describeScene(files);
  return (
    <section class="card" aria-label="Scene">
      <div class="body">
        <DropZone onFiles={onFiles} />
        {files.length > 0 && (
          <div class="found" role="status">
            {summary.format === null ? (
              <Notice tone={summary.photographs < 3 ? 'warning' : ''}>
                <strong>{count(summary.photographs)} photographs without cameras</strong>, {bytes(summary.bytes)}:{' '}
                {summary.photographs < 3
                  ? 'at least 3 are needed.'
                  : 'a worker with COLMAP estimates their cameras first.'}
              </Notice>
            ) : (
              <Notice>
                <strong>{summary.format} scene</strong>: {count(summary.photographs)} photographs, {count(files.length)}{' '}
                files, {bytes(summary.bytes)}
              </Notice>
            )}
            <button type="button" class="button small" onClick={() => onFiles([], '')} disabled={busy}>
              Take others
            </button>
          </div>
        )}
        {files.length === 0 && (
          <div class="field">
            <label for="reference">Or a folder that the coordinator sees</label>
            <input
              id="reference"
              class="wide"
              placeholder="file:campaign/7"
              value={reference}
              onInput={(event) => onReference(event.currentTarget.value)}
            />
          </div>
        )}
      </div>
    </section>
  );
}

interface NameAndShareProps {
  id: string;
  onId: (id: string) => void;
  weight: string;
  onWeight: (weight: string) => void;
}

function NameAndShare({ id, onId, weight, onWeight }: NameAndShareProps) {
  return (
    <section class="card" aria-label="Name and share">
      <div class="body fields">
        <div class="field grow">
          <label for="id">Name</label>
          <input
            id="id"
            class="wide"
            value={id}
            required
            maxLength={64}
            pattern="[a-z0-9][a-z0-9\-]*"
            aria-describedby="id-help"
            onInput={(event) => onId(event.currentTarget.value)}
          />
          <p id="id-help" class="muted small">
            a–z, 0–9 and “-”. Submitting again under the same name goes on with an interrupted upload.
          </p>
        </div>
        <div class="field">
          <label for="weight">Weight</label>
          <input
            id="weight"
            type="number"
            min="0.01"
            max="1000"
            step="any"
            value={weight}
            required
            aria-describedby="weight-help"
            onInput={(event) => onWeight(event.currentTarget.value)}
          />
          <p id="weight-help" class="muted small">
            share of the workers
          </p>
        </div>
      </div>
    </section>
  );
}

interface SubmitPageProps {
  again?: string | undefined; // the photographs of this reconstruction, with other options
  region?: number[] | undefined;
}

function AgainField({ again, region }: { again: string; region: number[] | undefined }) {
  return (
    <section class="card" aria-label="Scene">
      <div class="body">
        <Notice>
          The photographs of <a href={linkTo.reconstruction(again)}>{again}</a>, which are not uploaded again.
          {region !== undefined && (
            <>
              {' '}
              Only what lies in the box from ({region.slice(0, 3).map(short).join(', ')}) to (
              {region.slice(3).map(short).join(', ')}) is reconstructed.
            </>
          )}
        </Notice>
      </div>
    </section>
  );
}

const jsonBlob = (value: unknown) => new Blob([JSON.stringify(value)], { type: 'application/json' });

const short = (value: number) => Number(value.toPrecision(7));

export default function SubmitPage({ again, region }: SubmitPageProps) {
  const [files, setFiles] = useState<FileToSend[]>([]);
  const [reference, setReference] = useState('');
  const [id, setId] = useState('');
  const [weight, setWeight] = useState('1');
  const [options, setOptions] = useState<Option[]>([]);
  const [presets, setPresets] = useState<Preset[]>([]);
  const [preset, setPreset] = useState('normal');
  const [values, setValues] = useState<Record<string, string>>({});
  const [progress, setProgress] = useState<UploadProgress | null>(null);
  const [busy, setBusy] = useState(false);
  const [failure, setFailure] = useState('');
  const startMs = useRef(0);
  const uploader = useRef<Uploader | null>(null);
  useEffect(() => {
    api.options().then(
      (answer) => {
        setOptions(answer.options ?? []);
        setPresets(answer.presets ?? []);
      },
      (error: Error) => setFailure(`Options cannot be shown: ${error.message}`),
    );
    if (again !== undefined) void takeOver(again);
    return () => uploader.current?.stop();
  }, []);
  const takeOver = async (from: string) => {
    setId(`${from}-again`.slice(0, 64));
    try {
      const { optionsJson, weight: share } = await api.reconstruction(from);
      const before = JSON.parse(optionsJson || '{}') as Record<string, unknown>;
      setValues(Object.fromEntries(Object.entries(before).map(([name, value]) => [name, String(value)])));
      setWeight(String(share ?? 1));
    } catch (error) {
      setFailure((error as Error).message);
    }
  };
  // Leaving the page would end the upload.
  useEffect(() => {
    if (!busy) return;
    const warn = (event: BeforeUnloadEvent) => event.preventDefault();
    window.addEventListener('beforeunload', warn);
    return () => window.removeEventListener('beforeunload', warn);
  }, [busy]);

  const takeFiles = (taken: FileToSend[], name: string) => {
    setFiles(taken);
    if (id === '' && name !== '') setId(idFrom(name));
  };

  const send = async () => {
    const chosen = Object.entries(values).filter(([, value]) => value !== '');
    const said = Object.fromEntries(chosen.map(([name, value]) => [name, Number(value)]));
    const optionsJson = JSON.stringify({ ...presets.find(({ name }) => name === preset)?.values, ...said });
    if (again !== undefined) {
      await api.createAgain(again, { id, optionsJson, weight: Number(weight) });
    } else {
      const sceneReference = files.length > 0 ? '' : reference.trim();
      await api.create({ id, optionsJson, sceneReference, weight: Number(weight) });
    }
    const sent = region === undefined ? files : [...files, { path: 'region.json', blob: jsonBlob(region) }];
    if (sent.length > 0) {
      const digester = new Digester();
      startMs.current = Date.now();
      uploader.current = new Uploader({
        files: sent,
        listFiles: () => api.files(id),
        sendPart: sendPartTo(id),
        digest: digester.digest,
        onProgress: setProgress,
      });
      try {
        await uploader.current.run();
      } finally {
        digester.close();
      }
    }
    await api.start(id);
  };
  const submit = async (event: Event) => {
    event.preventDefault();
    setFailure('');
    setBusy(true);
    try {
      await send();
      location.hash = linkTo.reconstruction(id);
    } catch (error) {
      const { message } = error as Error;
      if (message !== 'stopped') setFailure(message);
    }
    setBusy(false);
  };

  const ready = VALID_ID.test(id) && (again !== undefined || files.length > 0 || reference.trim() !== '') && !busy;
  return (
    <>
      <div class="page-head">
        <PageTitle title="New reconstruction" />
      </div>
      <form class="submit" onSubmit={(event) => void submit(event)}>
        <div class="submit-main">
          {again !== undefined ? (
            <AgainField again={again} region={region} />
          ) : (
            <SceneField
              files={files}
              onFiles={takeFiles}
              reference={reference}
              onReference={setReference}
              busy={busy}
            />
          )}
          <NameAndShare id={id} onId={setId} weight={weight} onWeight={setWeight} />
          {failure !== '' && <Notice tone="danger">{failure}</Notice>}
          {busy && progress !== null && <UploadStatus progress={progress} startMs={startMs.current} />}
          <button class="button primary big" disabled={!ready}>
            {busy ? 'Submitting …' : 'Submit'}
          </button>
        </div>
        <section class="card options" aria-labelledby="options-title">
          <header>
            <h2 id="options-title">Options</h2>
            <span class="note">those that stay empty are as the preset has them</span>
          </header>
          <div class="body">
            {presets.length > 0 && <PresetField presets={presets} value={preset} onChange={setPreset} />}
            <Options
              options={withDefaults(options, presets.find(({ name }) => name === preset))}
              values={values}
              onChange={(name, value) => setValues({ ...values, [name]: value })}
            />
          </div>
        </section>
      </form>
    </>
  );
}
