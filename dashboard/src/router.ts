// SPDX-License-Identifier: Apache-2.0
// Addresses are in the fragment, so that the page needs nothing of whoever serves it.
import { signal } from '@preact/signals';

export type Route =
  | { page: 'reconstructions' }
  | { page: 'reconstruction'; id: string }
  | { page: 'workers' }
  // `again`: of the photographs of that reconstruction; `region`: xmin, ymin, zmin, xmax, ymax, zmax.
  | { page: 'submit'; again?: string; region?: number[] }
  | { page: 'unknown' };

export function parseRoute(hash: string): Route {
  const [first = '', second = '', third = ''] = hash.replace(/^#?\/?/, '').split('/');
  if (first === '') return { page: 'reconstructions' };
  if (first === 'reconstructions' && second !== '') return { page: 'reconstruction', id: decodeURIComponent(second) };
  if (first === 'reconstructions') return { page: 'reconstructions' };
  if (first === 'workers') return { page: first };
  if (first === 'submit' && second === '') return { page: first };
  if (first === 'submit') {
    const region = third.split(',').map(Number);
    const isRegion = third !== '' && region.length === 6 && region.every(Number.isFinite);
    return { page: first, again: decodeURIComponent(second), ...(isRegion ? { region } : {}) };
  }
  return { page: 'unknown' };
}

export const route = signal<Route>(parseRoute(location.hash));
window.addEventListener('hashchange', () => (route.value = parseRoute(location.hash)));

export const linkTo = {
  reconstructions: '#/',
  reconstruction: (id: string) => `#/reconstructions/${encodeURIComponent(id)}`,
  workers: '#/workers',
  submit: '#/submit',
  again: (id: string, region?: readonly number[]) =>
    `#/submit/${encodeURIComponent(id)}${region === undefined ? '' : `/${region.join(',')}`}`,
};
