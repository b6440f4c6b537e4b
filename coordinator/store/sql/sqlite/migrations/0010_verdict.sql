-- SPDX-License-Identifier: Apache-2.0
-- What a reconstruction came to, JSON, once it is done.
ALTER TABLE reconstructions ADD COLUMN verdict_json TEXT NOT NULL DEFAULT '';
