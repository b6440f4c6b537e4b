-- SPDX-License-Identifier: Apache-2.0
-- Who may what: keys, and whose reconstruction it is ('': nobody's in particular, operators see it).
ALTER TABLE reconstructions ADD COLUMN owner TEXT COLLATE "C" NOT NULL DEFAULT '';
CREATE INDEX reconstructions_by_owner ON reconstructions (owner);

CREATE TABLE access_tokens (
  id                TEXT COLLATE "C" PRIMARY KEY CHECK (id <> ''),
  digest            TEXT NOT NULL CHECK (length(digest) = 64),
  user_name         TEXT COLLATE "C" NOT NULL CHECK (user_name <> ''),
  role              TEXT NOT NULL CHECK (role IN ('viewer', 'submitter', 'operator', 'worker')),
  reconstruction_id TEXT COLLATE "C" NOT NULL DEFAULT '',
  created_at        BIGINT NOT NULL,
  expires_at        BIGINT,
  revoked_at        BIGINT
);
