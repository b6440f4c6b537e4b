-- SPDX-License-Identifier: Apache-2.0
-- When a reconstruction will presumably be done, and how far its mesh is once all cameras are committed.
ALTER TABLE reconstructions
  ADD COLUMN joined_thousandths BIGINT NOT NULL DEFAULT 0,
  ADD COLUMN expected_end_at    BIGINT;
