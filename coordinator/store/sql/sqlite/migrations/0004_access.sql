-- SPDX-License-Identifier: Apache-2.0
-- Who may what: keys, and whose reconstruction it is ('': nobody's in particular, operators see it).
ALTER TABLE reconstructions ADD COLUMN owner TEXT NOT NULL DEFAULT '';
CREATE INDEX reconstructions_by_owner ON reconstructions (owner);

CREATE TABLE access_tokens (
  id                TEXT PRIMARY KEY CHECK (length(id) > 0),
  digest            TEXT NOT NULL CHECK (length(digest) = 64),
  user_name         TEXT NOT NULL CHECK (length(user_name) > 0),
  role              TEXT NOT NULL CHECK (role IN ('viewer', 'submitter', 'operator', 'worker')),
  reconstruction_id TEXT NOT NULL DEFAULT '',
  created_at        INTEGER NOT NULL,
  expires_at        INTEGER,
  revoked_at        INTEGER
) STRICT;
