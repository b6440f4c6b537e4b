-- SPDX-License-Identifier: Apache-2.0
-- Workers say whether they can estimate cameras. The job that does so has sequence 2147483647.
ALTER TABLE workers ADD COLUMN colmap_version TEXT NOT NULL DEFAULT '';
