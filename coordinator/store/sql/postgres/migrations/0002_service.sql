-- SPDX-License-Identifier: Apache-2.0
-- What several coordinators share: how a reconstruction was asked for and how far it is, whole job specifications, the
-- history of attempts, scenes' files, and which blobs belong to whom.

ALTER TABLE reconstructions DROP CONSTRAINT reconstructions_state_check;
ALTER TABLE reconstructions ADD CONSTRAINT reconstructions_state_check CHECK (state IN (
  'created', 'preparing', 'running', 'joining', 'done', 'cancelled', 'failed', 'deleting'));
ALTER TABLE reconstructions DROP CONSTRAINT reconstructions_check;
ALTER TABLE reconstructions ADD CONSTRAINT reconstructions_check CHECK (
  scene_digest IS NOT NULL OR state IN ('created', 'preparing', 'cancelled', 'failed', 'deleting'));
ALTER TABLE reconstructions RENAME COLUMN weight TO weight_thousandths;
UPDATE reconstructions SET weight_thousandths = 1000 * weight_thousandths;
ALTER TABLE reconstructions ALTER COLUMN weight_thousandths SET DEFAULT 1000;
ALTER TABLE reconstructions
  ADD COLUMN scene_reference   TEXT NOT NULL DEFAULT '',
  ADD COLUMN scene_blob        TEXT CHECK (length(scene_blob) = 64),
  ADD COLUMN finished_at       BIGINT,
  ADD COLUMN mesh_digest       TEXT CHECK (length(mesh_digest) = 64),
  ADD COLUMN mesh_bytes        BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN vertices          BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN faces             BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN cameras_total     BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN cameras_committed BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN cameras_set_aside BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN cameras_in_flight BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN patches_filtered  BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN patches_accepted  BIGINT NOT NULL DEFAULT 0;
ALTER TABLE reconstructions SET (fillfactor = 60);

-- Every id that was ever taken, also those of deleted reconstructions.
CREATE TABLE reconstruction_ids (
  id TEXT COLLATE "C" PRIMARY KEY
);
INSERT INTO reconstruction_ids SELECT id FROM reconstructions;

ALTER TABLE camera_jobs
  ADD COLUMN neighbours      TEXT NOT NULL DEFAULT '',
  ADD COLUMN spec            TEXT NOT NULL DEFAULT '',
  ADD COLUMN losses          BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN reduction       BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN expected_digest TEXT CHECK (length(expected_digest) = 64),
  ADD COLUMN lease_instance  TEXT,
  ADD COLUMN leased_at       BIGINT,
  ADD COLUMN last_ending     TEXT NOT NULL DEFAULT '',
  ADD COLUMN last_ended_at   BIGINT NOT NULL DEFAULT 0;
CREATE INDEX filtered_surfaces ON camera_jobs (filtered_digest) WHERE filtered_digest IS NOT NULL;
CREATE INDEX accepted_surfaces ON commits (accepted_digest) WHERE accepted_digest IS NOT NULL;

-- Every lease that ended, whoever ended it; the last 16 of each job.
CREATE TABLE attempts (
  reconstruction_id TEXT COLLATE "C" NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  sequence          INTEGER NOT NULL,
  epoch             BIGINT NOT NULL,
  camera            INTEGER NOT NULL,
  worker            TEXT NOT NULL,
  began_at          BIGINT NOT NULL,
  ended_at          BIGINT NOT NULL,
  ending            TEXT NOT NULL CHECK (ending IN ('finished', 'failed', 'out_of_memory', 'lost', 'given_back')),
  reason            TEXT NOT NULL,
  PRIMARY KEY (reconstruction_id, sequence, epoch)
);
CREATE FUNCTION keep_attempt() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  INSERT INTO attempts
  VALUES (OLD.reconstruction_id, OLD.sequence, OLD.epoch, OLD.camera, OLD.lease_worker, coalesce(OLD.leased_at, 0),
          NEW.last_ended_at, NEW.last_ending,
          CASE WHEN NEW.last_ending IN ('finished', 'given_back') THEN ''
               ELSE coalesce(NEW.set_aside_reason, NEW.last_failure) END)
  ON CONFLICT DO NOTHING;
  IF OLD.epoch > 16 THEN
    DELETE FROM attempts WHERE reconstruction_id = OLD.reconstruction_id AND sequence = OLD.sequence
                           AND epoch <= OLD.epoch - 16;
  END IF;
  RETURN NULL;
END $$;
CREATE TRIGGER attempts_are_kept AFTER UPDATE OF lease_worker ON camera_jobs FOR EACH ROW
WHEN (OLD.lease_worker IS NOT NULL AND NEW.lease_worker IS NULL) EXECUTE FUNCTION keep_attempt();

CREATE TABLE scene_files (
  reconstruction_id TEXT COLLATE "C" NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  path              TEXT COLLATE "C" NOT NULL CHECK (path <> ''),
  size_bytes        BIGINT NOT NULL CHECK (size_bytes >= 0),
  digest            TEXT NOT NULL CHECK (length(digest) = 64),
  PRIMARY KEY (reconstruction_id, path)
);

-- Blobs that belong to a reconstruction beside its surfaces. The row is there before the blob.
CREATE TABLE held_blobs (
  reconstruction_id TEXT COLLATE "C" NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  digest            TEXT COLLATE "C" NOT NULL CHECK (length(digest) = 64),
  PRIMARY KEY (reconstruction_id, digest)
);
CREATE INDEX holders_of_blobs ON held_blobs (digest);

-- Blobs that go away now: nobody may put them before the row is gone.
CREATE TABLE vanishing_blobs (
  reconstruction_id TEXT COLLATE "C" NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  digest            TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (reconstruction_id, digest)
);
CREATE INDEX vanishing_blobs_by_digest ON vanishing_blobs (digest);

-- What workers could not read.
CREATE TABLE damaged_blobs (
  reconstruction_id TEXT COLLATE "C" NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  digest            TEXT NOT NULL,
  PRIMARY KEY (reconstruction_id, digest)
);

ALTER TABLE workers
  ADD COLUMN instance TEXT NOT NULL DEFAULT '',
  ADD COLUMN version  TEXT NOT NULL DEFAULT '',
  ADD COLUMN draining INTEGER NOT NULL DEFAULT 0 CHECK (draining IN (0, 1));
