// SPDX-License-Identifier: Apache-2.0
import { defineConfig } from 'vitest/config';

// In development the API is another process: a coordinator, or tests/dashboard/fake_api.
const api = process.env.MESHWRIGHT_API ?? 'http://127.0.0.1:7421';

export default defineConfig({
  base: './', // the page may stand below any path of a proxy
  build: { target: 'es2022', chunkSizeWarningLimit: 800 },
  worker: { format: 'es' },
  server: { proxy: { '/v1': api } },
  test: { include: ['src/**/*.test.ts'] },
});
