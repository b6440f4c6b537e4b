-- SPDX-License-Identifier: Apache-2.0
-- When a reconstruction will presumably be done, and how far its mesh is once all cameras are committed.
ALTER TABLE reconstructions ADD COLUMN joined_thousandths INTEGER NOT NULL DEFAULT 0;
ALTER TABLE reconstructions ADD COLUMN expected_end_at INTEGER;
