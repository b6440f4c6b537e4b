-- SPDX-License-Identifier: Apache-2.0
-- The version of the method that a reconstruction was begun with, and that a worker has. What was there before was of
-- the first; a worker that does not say it is of none.
ALTER TABLE reconstructions ADD COLUMN method_version BIGINT NOT NULL DEFAULT 1;
ALTER TABLE workers ADD COLUMN method_version BIGINT NOT NULL DEFAULT 0;
