// SPDX-License-Identifier: Apache-2.0
import { effect, signal } from '@preact/signals';

export type Theme = 'light' | 'dark';

const KEY = 'meshwright-theme';
const system = window.matchMedia('(prefers-color-scheme: dark)');

function remembered(): Theme | null {
  try {
    const value = localStorage.getItem(KEY);
    return value === 'light' || value === 'dark' ? value : null;
  } catch {
    return null; // storage is forbidden
  }
}

const systemTheme = (): Theme => (system.matches ? 'dark' : 'light');

export const theme = signal<Theme>(remembered() ?? systemTheme());

system.addEventListener('change', () => {
  if (remembered() === null) theme.value = systemTheme();
});

export function chooseTheme(value: Theme) {
  theme.value = value;
  try {
    localStorage.setItem(KEY, value);
  } catch {
    // It holds until the page is closed.
  }
}

effect(() => {
  document.documentElement.dataset.theme = theme.value;
});

export function cssColor(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}
