-- SPDX-License-Identifier: Apache-2.0
-- Several coordinators and workers: more states of a reconstruction, leases with failed attempts, conductors, workers.

-- SQLite cannot change a CHECK of a table that is there, so the table is made anew. (Foreign keys are not checked
-- while migrations run.)
CREATE TABLE new_reconstructions (
  id           TEXT PRIMARY KEY CHECK (length(id) > 0),
  options_json TEXT NOT NULL CHECK (json_valid(options_json)),
  scene_digest TEXT CHECK (length(scene_digest) = 64),
  state        TEXT NOT NULL DEFAULT 'running' CHECK (state IN ('created', 'running', 'done', 'cancelled', 'failed')),
  created_at   INTEGER NOT NULL,
  state_reason TEXT NOT NULL DEFAULT '',
  weight       INTEGER NOT NULL DEFAULT 1 CHECK (weight >= 1),
  CHECK (scene_digest IS NOT NULL OR state IN ('created', 'cancelled', 'failed'))
) STRICT;
INSERT INTO new_reconstructions (id, options_json, scene_digest, state, created_at)
SELECT id, options_json, scene_digest, state, created_at FROM reconstructions;
DROP TABLE reconstructions;
ALTER TABLE new_reconstructions RENAME TO reconstructions;

ALTER TABLE camera_jobs ADD COLUMN memory_bytes INTEGER NOT NULL DEFAULT 0 CHECK (memory_bytes >= 0);
ALTER TABLE camera_jobs ADD COLUMN failed_attempts INTEGER NOT NULL DEFAULT 0 CHECK (failed_attempts >= 0);
ALTER TABLE camera_jobs ADD COLUMN out_of_memory_failures INTEGER NOT NULL DEFAULT 0
  CHECK (out_of_memory_failures BETWEEN 0 AND failed_attempts);
ALTER TABLE camera_jobs ADD COLUMN last_failure TEXT NOT NULL DEFAULT '';
ALTER TABLE camera_jobs ADD COLUMN not_before INTEGER NOT NULL DEFAULT 0;
ALTER TABLE camera_jobs ADD COLUMN lease_worker TEXT
  CHECK (lease_worker IS NULL OR (length(lease_worker) > 0 AND state = 'assigned'));
ALTER TABLE camera_jobs ADD COLUMN lease_expires_at INTEGER
  CHECK ((lease_worker IS NULL) = (lease_expires_at IS NULL));
CREATE INDEX assigned_camera_jobs ON camera_jobs (sequence, reconstruction_id) WHERE state = 'assigned';

CREATE TABLE conductor_leases (
  reconstruction_id TEXT PRIMARY KEY REFERENCES reconstructions (id) ON DELETE CASCADE,
  owner             TEXT NOT NULL CHECK (length(owner) > 0),
  epoch             INTEGER NOT NULL CHECK (epoch >= 1),
  expires_at        INTEGER NOT NULL
) STRICT;

CREATE TABLE workers (
  id             TEXT PRIMARY KEY CHECK (length(id) > 0),
  cores          INTEGER NOT NULL CHECK (cores >= 0),
  memory_bytes   INTEGER NOT NULL CHECK (memory_bytes >= 0),
  last_heartbeat INTEGER NOT NULL,
  drained        INTEGER NOT NULL DEFAULT 0 CHECK (drained IN (0, 1))
) STRICT;
