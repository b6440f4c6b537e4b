-- SPDX-License-Identifier: Apache-2.0
-- Times are microseconds since 1970 (UTC), given by the caller. The same tables and invariants as in SQLite.

CREATE TABLE reconstructions (
  id           TEXT COLLATE "C" PRIMARY KEY CHECK (id <> ''),
  options_json JSON NOT NULL,  -- JSON, not JSONB: keeps the text as it was given
  scene_digest TEXT CHECK (length(scene_digest) = 64),
  state        TEXT NOT NULL CHECK (state IN ('created', 'running', 'done', 'cancelled', 'failed')),
  created_at   BIGINT NOT NULL,
  state_reason TEXT NOT NULL DEFAULT '',
  weight       BIGINT NOT NULL DEFAULT 1 CHECK (weight >= 1),
  CHECK (scene_digest IS NOT NULL OR state IN ('created', 'cancelled', 'failed'))
);

-- Leases change rows over and over: free room in each page lets the new version lie beside the old one, and no index
-- is touched.
CREATE TABLE camera_jobs (
  reconstruction_id      TEXT COLLATE "C" NOT NULL REFERENCES reconstructions (id) ON DELETE CASCADE,
  sequence               INTEGER NOT NULL CHECK (sequence >= 1),
  camera                 INTEGER NOT NULL CHECK (camera >= 0),
  snapshot               INTEGER NOT NULL CHECK (snapshot >= 0 AND snapshot < sequence),
  state                  TEXT NOT NULL DEFAULT 'assigned' CHECK (state IN ('assigned', 'done', 'set_aside')),
  epoch                  BIGINT NOT NULL DEFAULT 1 CHECK (epoch >= 1),
  filtered_digest        TEXT CHECK (length(filtered_digest) = 64),
  weak_targets           TEXT NOT NULL DEFAULT '',
  report_json            JSON,
  set_aside_reason       TEXT,
  assigned_at            BIGINT NOT NULL,
  finished_at            BIGINT,
  memory_bytes           BIGINT NOT NULL DEFAULT 0 CHECK (memory_bytes >= 0),
  failed_attempts        BIGINT NOT NULL DEFAULT 0 CHECK (failed_attempts >= 0),
  out_of_memory_failures BIGINT NOT NULL DEFAULT 0 CHECK (out_of_memory_failures BETWEEN 0 AND failed_attempts),
  last_failure           TEXT NOT NULL DEFAULT '',
  not_before             BIGINT NOT NULL DEFAULT 0,
  lease_worker           TEXT CHECK (lease_worker <> ''),
  lease_expires_at       BIGINT,
  PRIMARY KEY (reconstruction_id, sequence),
  UNIQUE (reconstruction_id, camera),
  CHECK ((state = 'done') = (filtered_digest IS NOT NULL AND report_json IS NOT NULL)),
  CHECK ((state = 'set_aside') = (set_aside_reason IS NOT NULL)),
  CHECK ((state = 'assigned') = (finished_at IS NULL)),
  CHECK (lease_worker IS NULL OR state = 'assigned'),
  CHECK ((lease_worker IS NULL) = (lease_expires_at IS NULL))
) WITH (fillfactor = 60);
CREATE INDEX assigned_camera_jobs ON camera_jobs (sequence, reconstruction_id) WHERE state = 'assigned';

CREATE TABLE commits (
  reconstruction_id TEXT COLLATE "C" NOT NULL,
  sequence          INTEGER NOT NULL CHECK (sequence >= 1),
  camera            INTEGER NOT NULL,
  accepted_digest   TEXT CHECK (length(accepted_digest) = 64),
  filtered_patches  BIGINT NOT NULL CHECK (filtered_patches >= 0),
  accepted_patches  BIGINT NOT NULL CHECK (accepted_patches >= 0 AND accepted_patches <= filtered_patches),
  committed_at      BIGINT NOT NULL,
  PRIMARY KEY (reconstruction_id, sequence),
  FOREIGN KEY (reconstruction_id, sequence) REFERENCES camera_jobs (reconstruction_id, sequence) ON DELETE CASCADE,
  CHECK ((accepted_patches > 0) = (accepted_digest IS NOT NULL))
);

-- Commits come one after the other, and only for finished jobs of the same camera. (The primary key forbids a second
-- one of the same number, so it is enough that the one before is there.)
CREATE FUNCTION check_commit_order() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF NEW.sequence > 1 AND NOT EXISTS (SELECT 1 FROM commits WHERE reconstruction_id = NEW.reconstruction_id
                                                              AND sequence = NEW.sequence - 1) THEN
    RAISE EXCEPTION 'commit out of order' USING ERRCODE = 'check_violation';
  END IF;
  IF NOT EXISTS (SELECT 1 FROM camera_jobs WHERE reconstruction_id = NEW.reconstruction_id
                                             AND sequence = NEW.sequence AND camera = NEW.camera
                                             AND state IN ('done', 'set_aside')) THEN
    RAISE EXCEPTION 'commit of a job that is not finished' USING ERRCODE = 'check_violation';
  END IF;
  RETURN NEW;
END $$;
CREATE TRIGGER commits_in_order BEFORE INSERT ON commits FOR EACH ROW EXECUTE FUNCTION check_commit_order();

CREATE FUNCTION refuse_commit_change() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  RAISE EXCEPTION 'a commit never changes' USING ERRCODE = 'check_violation';
END $$;
CREATE TRIGGER commits_stay BEFORE UPDATE ON commits FOR EACH ROW EXECUTE FUNCTION refuse_commit_change();

CREATE TABLE conductor_leases (
  reconstruction_id TEXT COLLATE "C" PRIMARY KEY REFERENCES reconstructions (id) ON DELETE CASCADE,
  owner             TEXT NOT NULL CHECK (owner <> ''),
  epoch             BIGINT NOT NULL CHECK (epoch >= 1),
  expires_at        BIGINT NOT NULL
);

CREATE TABLE workers (
  id             TEXT COLLATE "C" PRIMARY KEY CHECK (id <> ''),
  cores          BIGINT NOT NULL CHECK (cores >= 0),
  memory_bytes   BIGINT NOT NULL CHECK (memory_bytes >= 0),
  last_heartbeat BIGINT NOT NULL,
  drained        INTEGER NOT NULL DEFAULT 0 CHECK (drained IN (0, 1))
) WITH (fillfactor = 60);
