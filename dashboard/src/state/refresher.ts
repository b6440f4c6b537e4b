// SPDX-License-Identifier: Apache-2.0
// Runs a fetch again when somebody says that its answer is old: never twice at once, and not more often than is decent,
// which is longer for answers that take long.
export class Refresher {
  private dirty = false;
  private running = false;
  private closed = false;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly run: () => Promise<void>,
    private readonly restMs: number,
  ) {}

  request() {
    if (this.closed) return;
    this.dirty = true;
    if (!this.running && this.timer === undefined) void this.start();
  }

  close() {
    this.closed = true;
    clearTimeout(this.timer);
  }

  private async start() {
    this.running = true;
    this.dirty = false;
    const began = performance.now();
    try {
      await this.run();
    } catch {
      this.dirty = true; // tried again after the rest
    }
    this.running = false;
    if (this.closed) return;
    const rest = Math.max(this.restMs, 5 * (performance.now() - began));
    this.timer = setTimeout(() => {
      this.timer = undefined;
      if (this.dirty && !this.closed) void this.start();
    }, rest);
  }
}
