// SPDX-License-Identifier: Apache-2.0
import { useEffect, useRef, useState } from 'preact/hooks';

// Runs at once and then every `everyMs` while the page is looked at; `null` until the first answer.
export function usePolled<T>(fetch: () => Promise<T>, everyMs: number) {
  const [value, setValue] = useState<T | null>(null);
  const [error, setError] = useState<Error | null>(null);
  const refresh = useRef(() => {});
  useEffect(() => {
    let closed = false;
    let timer: ReturnType<typeof setTimeout> | undefined;
    const run = async () => {
      clearTimeout(timer);
      try {
        const answer = await fetch();
        if (closed) return;
        setValue(answer);
        setError(null);
      } catch (problem) {
        if (closed) return;
        setError(problem as Error);
      }
      timer = setTimeout(next, everyMs);
    };
    const next = () => {
      if (document.visibilityState === 'visible') void run();
      else timer = setTimeout(next, everyMs);
    };
    refresh.current = () => void run();
    void run();
    return () => {
      closed = true;
      clearTimeout(timer);
    };
  }, []);
  return { value, error, refresh: () => refresh.current() };
}

// The time, ticking.
export function useNow(everyMs = 1000): number {
  const [now, setNow] = useState(Date.now());
  useEffect(() => {
    const timer = setInterval(() => setNow(Date.now()), everyMs);
    return () => clearInterval(timer);
  }, [everyMs]);
  return now;
}

// Whether the element is on the screen, for work that only then makes sense.
export function useVisible(ref: { current: Element | null }): boolean {
  const [visible, setVisible] = useState(false);
  useEffect(() => {
    if (ref.current === null) return;
    const observer = new IntersectionObserver((entries) => setVisible(entries.at(-1)!.isIntersecting));
    observer.observe(ref.current);
    return () => observer.disconnect();
  }, []);
  return visible;
}

// Width of the element, px.
export function useWidth(ref: { current: HTMLElement | null }): number {
  const [width, setWidth] = useState(0);
  useEffect(() => {
    if (ref.current === null) return;
    const observer = new ResizeObserver((entries) => setWidth(Math.floor(entries.at(-1)!.contentRect.width)));
    observer.observe(ref.current);
    return () => observer.disconnect();
  }, []);
  return width;
}
