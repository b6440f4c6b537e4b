// SPDX-License-Identifier: Apache-2.0
// Addresses are in the fragment, so that the page needs nothing of whoever serves it.
import { signal } from '@preact/signals';

export type Route =
  | { page: 'reconstructions' }
  | { page: 'reconstruction'; id: string }
  | { page: 'workers' }
  | { page: 'submit' }
  | { page: 'unknown' };

export function parseRoute(hash: string): Route {
  const [first = '', second = ''] = hash.replace(/^#?\/?/, '').split('/');
  if (first === '') return { page: 'reconstructions' };
  if (first === 'reconstructions' && second !== '') return { page: 'reconstruction', id: decodeURIComponent(second) };
  if (first === 'reconstructions') return { page: 'reconstructions' };
  if (first === 'workers' || first === 'submit') return { page: first };
  return { page: 'unknown' };
}

export const route = signal<Route>(parseRoute(location.hash));
window.addEventListener('hashchange', () => (route.value = parseRoute(location.hash)));

export const linkTo = {
  reconstructions: '#/',
  reconstruction: (id: string) => `#/reconstructions/${encodeURIComponent(id)}`,
  workers: '#/workers',
  submit: '#/submit',
};
