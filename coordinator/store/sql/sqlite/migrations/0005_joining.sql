-- SPDX-License-Identifier: Apache-2.0
-- A reconstruction in one process was done before its mesh was written. Now it is joining until then, as others are.
UPDATE reconstructions SET state = 'joining', finished_at = NULL WHERE state = 'done' AND mesh_digest IS NULL;
