// SPDX-License-Identifier: Apache-2.0
import { lazy, Suspense } from 'preact/compat';
import { useState } from 'preact/hooks';
import { beginSession, tokenWanted } from './api/client';
import { PageTitle } from './components/pieces';
import { ReconstructionsPage } from './pages/reconstructions';
import { linkTo, route } from './router';
import { chooseTheme, theme } from './theme';
import { untilLoaded } from './until_loaded';

// three.js and the charts come with the page that needs them.
const ReconstructionPage = lazy(() => untilLoaded(() => import('./pages/reconstruction')));
const WorkersPage = lazy(() => untilLoaded(() => import('./pages/workers')));
const SubmitPage = lazy(() => untilLoaded(() => import('./pages/submit')));

function Logo() {
  return (
    <svg viewBox="0 0 32 32" aria-hidden="true">
      <path d="M3 26 16 4l13 22z" fill="var(--accent)" />
      <path
        d="M3 26 16 17l13 9M16 4v13"
        fill="none"
        stroke="var(--surface)"
        stroke-width="1.8"
        stroke-linejoin="round"
      />
    </svg>
  );
}

function ThemeButton() {
  const dark = theme.value === 'dark';
  return (
    <button
      class="button icon small end"
      onClick={() => chooseTheme(dark ? 'light' : 'dark')}
      aria-label={dark ? 'Light colours' : 'Dark colours'}
      title={dark ? 'Light colours' : 'Dark colours'}
    >
      <svg viewBox="0 0 20 20" width="16" height="16" aria-hidden="true" fill="currentcolor">
        {dark ? (
          <circle cx="10" cy="10" r="7" fill="none" stroke="currentcolor" stroke-width="2" />
        ) : (
          <path d="M8 2a8 8 0 1 0 10 10A7 7 0 0 1 8 2" />
        )}
      </svg>
    </button>
  );
}

function TokenForm() {
  const [token, setToken] = useState('');
  const [refused, setRefused] = useState(false);
  const submit = async (event: Event) => {
    event.preventDefault();
    if (await beginSession(token)) location.reload();
    else setRefused(true);
  };
  return (
    <form class="card" style={{ padding: '20px', maxWidth: '460px' }} onSubmit={submit}>
      <PageTitle title="A key is wanted" />
      <p class="muted" style={{ margin: '6px 0 14px' }}>
        This coordinator asks for a key. It stays in this browser until that is closed.
      </p>
      {refused && <p role="alert">The coordinator does not know this key.</p>}
      <label>
        Key
        <br />
        <input
          type="password"
          autoComplete="current-password"
          value={token}
          onInput={(event) => setToken(event.currentTarget.value)}
          required
        />
      </label>{' '}
      <button class="button primary">Go on</button>
    </form>
  );
}

function CurrentPage() {
  const current = route.value;
  if (tokenWanted.value) return <TokenForm />;
  switch (current.page) {
    case 'reconstructions':
      return <ReconstructionsPage />;
    case 'reconstruction':
      return <ReconstructionPage key={current.id} id={current.id} />;
    case 'workers':
      return <WorkersPage />;
    case 'submit':
      return <SubmitPage key={`${current.again}/${current.region}`} again={current.again} region={current.region} />;
    case 'unknown':
      return (
        <>
          <PageTitle title="There is no such page" />
          <p>
            <a href={linkTo.reconstructions}>Reconstructions</a>
          </p>
        </>
      );
  }
}

export function App() {
  const page = route.value.page;
  const current = (mine: boolean) => (mine ? ('page' as const) : undefined);
  const skip = (event: Event) => {
    event.preventDefault(); // the fragment is the page's address
    document.querySelector<HTMLElement>('main')?.focus();
  };
  return (
    <>
      <a class="skip" href="#main" onClick={skip}>
        Skip to the content
      </a>
      <header class="top">
        <a class="brand" href={linkTo.reconstructions} aria-label="Meshwright, all reconstructions">
          <Logo />
          <span>Meshwright</span>
        </a>
        <nav aria-label="Pages">
          <a
            href={linkTo.reconstructions}
            aria-current={current(page === 'reconstructions' || page === 'reconstruction')}
          >
            Reconstructions
          </a>
          <a href={linkTo.workers} aria-current={current(page === 'workers')}>
            Workers
          </a>
          <a href={linkTo.submit} aria-current={current(page === 'submit')}>
            Submit
          </a>
        </nav>
        <ThemeButton />
      </header>
      <main id="main" tabIndex={-1}>
        <Suspense fallback={<p class="muted">Loading …</p>}>
          <CurrentPage />
        </Suspense>
      </main>
    </>
  );
}
