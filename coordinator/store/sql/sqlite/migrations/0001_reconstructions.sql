-- SPDX-License-Identifier: Apache-2.0
-- Times are microseconds since 1970 (UTC), given by the caller.

CREATE TABLE reconstructions (
  id           TEXT PRIMARY KEY CHECK (length(id) > 0),
  options_json TEXT NOT NULL CHECK (json_valid(options_json)),
  scene_digest TEXT NOT NULL CHECK (length(scene_digest) = 64),
  state        TEXT NOT NULL DEFAULT 'running' CHECK (state IN ('running', 'done')),
  created_at   INTEGER NOT NULL
) STRICT;

CREATE TABLE camera_jobs (
  reconstruction_id TEXT NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  sequence          INTEGER NOT NULL CHECK (sequence >= 1),
  camera            INTEGER NOT NULL CHECK (camera >= 0),
  snapshot          INTEGER NOT NULL CHECK (snapshot >= 0 AND snapshot < sequence),
  state             TEXT NOT NULL DEFAULT 'assigned' CHECK (state IN ('assigned', 'done', 'set_aside')),
  epoch             INTEGER NOT NULL DEFAULT 1 CHECK (epoch >= 1),
  filtered_digest   TEXT CHECK (length(filtered_digest) = 64),
  weak_targets      TEXT NOT NULL DEFAULT '',
  report_json       TEXT CHECK (report_json IS NULL OR json_valid(report_json)),
  set_aside_reason  TEXT,
  assigned_at       INTEGER NOT NULL,
  finished_at       INTEGER,
  PRIMARY KEY (reconstruction_id, sequence),
  UNIQUE (reconstruction_id, camera),
  CHECK ((state = 'done') = (filtered_digest IS NOT NULL AND report_json IS NOT NULL)),
  CHECK ((state = 'set_aside') = (set_aside_reason IS NOT NULL)),
  CHECK ((state = 'assigned') = (finished_at IS NULL))
) STRICT;

CREATE TABLE commits (
  reconstruction_id TEXT NOT NULL,
  sequence          INTEGER NOT NULL CHECK (sequence >= 1),
  camera            INTEGER NOT NULL,
  accepted_digest   TEXT CHECK (length(accepted_digest) = 64),
  filtered_patches  INTEGER NOT NULL CHECK (filtered_patches >= 0),
  accepted_patches  INTEGER NOT NULL CHECK (accepted_patches >= 0 AND accepted_patches <= filtered_patches),
  committed_at      INTEGER NOT NULL,
  PRIMARY KEY (reconstruction_id, sequence),
  FOREIGN KEY (reconstruction_id, sequence) REFERENCES camera_jobs (reconstruction_id, sequence) ON DELETE CASCADE,
  CHECK ((accepted_patches > 0) = (accepted_digest IS NOT NULL))
) STRICT;

-- Commits come one after the other, and only for finished jobs of the same camera.
CREATE TRIGGER commits_in_order BEFORE INSERT ON commits
BEGIN
  SELECT RAISE(ABORT, 'commit out of order')
  WHERE NEW.sequence <> 1 + (SELECT coalesce(max(sequence), 0) FROM commits
                            WHERE reconstruction_id = NEW.reconstruction_id);
  SELECT RAISE(ABORT, 'commit of a job that is not finished')
  WHERE NOT EXISTS (SELECT 1 FROM camera_jobs
                    WHERE reconstruction_id = NEW.reconstruction_id AND sequence = NEW.sequence
                      AND camera = NEW.camera AND state IN ('done', 'set_aside'));
END;

CREATE TRIGGER commits_stay BEFORE UPDATE ON commits
BEGIN
  SELECT RAISE(ABORT, 'a commit never changes');
END;
