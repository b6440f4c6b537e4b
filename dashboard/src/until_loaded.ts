// SPDX-License-Identifier: Apache-2.0
const RETRY_MS = 3000;

// A part of the page's own code, until it comes: a coordinator that is started anew is there again soon.
export async function untilLoaded<T>(load: () => Promise<T>): Promise<T> {
  for (;;) {
    try {
      return await load();
    } catch {
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
    }
  }
}
