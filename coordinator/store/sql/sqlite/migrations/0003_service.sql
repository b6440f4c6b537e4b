-- SPDX-License-Identifier: Apache-2.0
-- What several coordinators share: how a reconstruction was asked for and how far it is, whole job specifications, the
-- history of attempts, scenes' files, and which blobs belong to whom.

CREATE TABLE new_reconstructions (
  id                 TEXT PRIMARY KEY CHECK (length(id) > 0),
  options_json       TEXT NOT NULL CHECK (json_valid(options_json)),
  scene_digest       TEXT CHECK (length(scene_digest) = 64),
  state              TEXT NOT NULL DEFAULT 'running' CHECK (state IN (
                       'created', 'preparing', 'running', 'joining', 'done', 'cancelled', 'failed', 'deleting')),
  created_at         INTEGER NOT NULL,
  state_reason       TEXT NOT NULL DEFAULT '',
  weight_thousandths INTEGER NOT NULL DEFAULT 1000 CHECK (weight_thousandths >= 1),
  scene_reference    TEXT NOT NULL DEFAULT '',
  scene_blob         TEXT CHECK (length(scene_blob) = 64),
  finished_at        INTEGER,
  mesh_digest        TEXT CHECK (length(mesh_digest) = 64),
  mesh_bytes         INTEGER NOT NULL DEFAULT 0,
  vertices           INTEGER NOT NULL DEFAULT 0,
  faces              INTEGER NOT NULL DEFAULT 0,
  cameras_total      INTEGER NOT NULL DEFAULT 0,
  cameras_committed  INTEGER NOT NULL DEFAULT 0,
  cameras_set_aside  INTEGER NOT NULL DEFAULT 0,
  cameras_in_flight  INTEGER NOT NULL DEFAULT 0,
  patches_filtered   INTEGER NOT NULL DEFAULT 0,
  patches_accepted   INTEGER NOT NULL DEFAULT 0,
  CHECK (scene_digest IS NOT NULL OR state IN ('created', 'preparing', 'cancelled', 'failed', 'deleting'))
) STRICT;
INSERT INTO new_reconstructions (id, options_json, scene_digest, state, created_at, state_reason, weight_thousandths)
SELECT id, options_json, scene_digest, state, created_at, state_reason, 1000 * weight FROM reconstructions;
DROP TABLE reconstructions;
ALTER TABLE new_reconstructions RENAME TO reconstructions;

-- Every id that was ever taken, also those of deleted reconstructions.
CREATE TABLE reconstruction_ids (
  id TEXT PRIMARY KEY
) STRICT;
INSERT INTO reconstruction_ids SELECT id FROM reconstructions;

ALTER TABLE camera_jobs ADD COLUMN neighbours TEXT NOT NULL DEFAULT '';
ALTER TABLE camera_jobs ADD COLUMN spec TEXT NOT NULL DEFAULT '';
ALTER TABLE camera_jobs ADD COLUMN losses INTEGER NOT NULL DEFAULT 0;
ALTER TABLE camera_jobs ADD COLUMN reduction INTEGER NOT NULL DEFAULT 0;
ALTER TABLE camera_jobs ADD COLUMN expected_digest TEXT CHECK (length(expected_digest) = 64);
ALTER TABLE camera_jobs ADD COLUMN lease_instance TEXT;
ALTER TABLE camera_jobs ADD COLUMN leased_at INTEGER;
ALTER TABLE camera_jobs ADD COLUMN last_ending TEXT NOT NULL DEFAULT '';
ALTER TABLE camera_jobs ADD COLUMN last_ended_at INTEGER NOT NULL DEFAULT 0;
CREATE INDEX filtered_surfaces ON camera_jobs (filtered_digest) WHERE filtered_digest IS NOT NULL;
CREATE INDEX accepted_surfaces ON commits (accepted_digest) WHERE accepted_digest IS NOT NULL;

-- Every lease that ended, whoever ended it; the last 16 of each job.
CREATE TABLE attempts (
  reconstruction_id TEXT NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  sequence          INTEGER NOT NULL,
  epoch             INTEGER NOT NULL,
  camera            INTEGER NOT NULL,
  worker            TEXT NOT NULL,
  began_at          INTEGER NOT NULL,
  ended_at          INTEGER NOT NULL,
  ending            TEXT NOT NULL CHECK (ending IN ('finished', 'failed', 'out_of_memory', 'lost', 'given_back')),
  reason            TEXT NOT NULL,
  PRIMARY KEY (reconstruction_id, sequence, epoch)
) STRICT;
CREATE TRIGGER attempts_are_kept AFTER UPDATE OF lease_worker ON camera_jobs
WHEN OLD.lease_worker IS NOT NULL AND NEW.lease_worker IS NULL
BEGIN
  INSERT OR REPLACE INTO attempts
  VALUES (OLD.reconstruction_id, OLD.sequence, OLD.epoch, OLD.camera, OLD.lease_worker, coalesce(OLD.leased_at, 0),
          NEW.last_ended_at, NEW.last_ending,
          CASE WHEN NEW.last_ending IN ('finished', 'given_back') THEN ''
               ELSE coalesce(NEW.set_aside_reason, NEW.last_failure) END);
  DELETE FROM attempts WHERE reconstruction_id = OLD.reconstruction_id AND sequence = OLD.sequence
                         AND epoch <= OLD.epoch - 16;
END;

CREATE TABLE scene_files (
  reconstruction_id TEXT NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  path              TEXT NOT NULL CHECK (length(path) > 0),
  size_bytes        INTEGER NOT NULL CHECK (size_bytes >= 0),
  digest            TEXT NOT NULL CHECK (length(digest) = 64),
  PRIMARY KEY (reconstruction_id, path)
) STRICT;

-- Blobs that belong to a reconstruction beside its surfaces. The row is there before the blob.
CREATE TABLE held_blobs (
  reconstruction_id TEXT NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  digest            TEXT NOT NULL CHECK (length(digest) = 64),
  PRIMARY KEY (reconstruction_id, digest)
) STRICT;
CREATE INDEX holders_of_blobs ON held_blobs (digest);

-- Blobs that go away now: nobody may put them before the row is gone.
CREATE TABLE vanishing_blobs (
  reconstruction_id TEXT NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  digest            TEXT NOT NULL,
  PRIMARY KEY (reconstruction_id, digest)
) STRICT;
CREATE INDEX vanishing_blobs_by_digest ON vanishing_blobs (digest);

-- What workers could not read.
CREATE TABLE damaged_blobs (
  reconstruction_id TEXT NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  digest            TEXT NOT NULL,
  PRIMARY KEY (reconstruction_id, digest)
) STRICT;

ALTER TABLE workers ADD COLUMN instance TEXT NOT NULL DEFAULT '';
ALTER TABLE workers ADD COLUMN version TEXT NOT NULL DEFAULT '';
ALTER TABLE workers ADD COLUMN draining INTEGER NOT NULL DEFAULT 0 CHECK (draining IN (0, 1));
