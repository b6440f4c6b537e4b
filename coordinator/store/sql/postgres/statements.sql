-- What PostgreSQL says in its own way. FOR SHARE of the conductor's lease: nobody takes over between this check and the
-- end of the transaction, so the next conductor sees what was written.

-- name: now
SELECT CAST(floor(extract(epoch FROM clock_timestamp()) * 1000000) AS BIGINT);

-- name: set_reconstruction_state
UPDATE reconstructions SET state = :state, state_reason = :reason
WHERE id = :id AND state IN ('created', 'running')
  AND (CAST(:conductor_epoch AS BIGINT) = 0 OR EXISTS (SELECT 1 FROM conductor_leases
                                                       WHERE reconstruction_id = :id AND epoch = :conductor_epoch
                                                       FOR SHARE));

-- name: assign_camera_job
INSERT INTO camera_jobs (reconstruction_id, sequence, camera, snapshot, assigned_at, memory_bytes)
SELECT CAST(:id AS TEXT), CAST(:sequence AS INTEGER), CAST(:camera AS INTEGER), CAST(:snapshot AS INTEGER),
       CAST(:now AS BIGINT), CAST(:memory_bytes AS BIGINT)
WHERE CAST(:conductor_epoch AS BIGINT) = 0 OR EXISTS (SELECT 1 FROM conductor_leases
                                                      WHERE reconstruction_id = :id AND epoch = :conductor_epoch
                                                      FOR SHARE)
ON CONFLICT DO NOTHING;

-- name: add_commit
INSERT INTO commits (reconstruction_id, sequence, camera, accepted_digest, filtered_patches, accepted_patches,
                     committed_at)
SELECT CAST(:id AS TEXT), CAST(:sequence AS INTEGER), CAST(:camera AS INTEGER), CAST(:accepted_digest AS TEXT),
       CAST(:filtered_patches AS BIGINT), CAST(:accepted_patches AS BIGINT), CAST(:now AS BIGINT)
WHERE CAST(:conductor_epoch AS BIGINT) = 0 OR EXISTS (SELECT 1 FROM conductor_leases
                                                      WHERE reconstruction_id = :id AND epoch = :conductor_epoch
                                                      FOR SHARE)
ON CONFLICT DO NOTHING;

-- name: lease_camera_jobs
WITH turns AS (
  SELECT value AS id, ordinality AS turn
  FROM json_array_elements_text(CAST(:reconstruction_ids AS JSON)) WITH ORDINALITY
), candidates AS (
  SELECT j.reconstruction_id, j.sequence
  FROM camera_jobs AS j
  JOIN reconstructions AS r ON r.id = j.reconstruction_id
  LEFT JOIN turns ON turns.id = j.reconstruction_id
  WHERE j.state = 'assigned' AND r.state = 'running'
    AND (j.lease_expires_at IS NULL OR j.lease_expires_at <= :now)
    AND j.not_before <= :now AND j.memory_bytes <= :memory_bytes
    AND (turns.turn IS NOT NULL OR json_array_length(CAST(:reconstruction_ids AS JSON)) = 0)
  ORDER BY turns.turn, j.sequence, j.reconstruction_id
  LIMIT :max_jobs
  FOR UPDATE OF j SKIP LOCKED
)
UPDATE camera_jobs AS j
SET epoch = j.epoch + 1, failed_attempts = j.failed_attempts + CAST(j.lease_worker IS NOT NULL AS INTEGER),
    last_failure = CASE WHEN j.lease_worker IS NULL THEN j.last_failure
                        ELSE 'the lease of worker ' || j.lease_worker || ' ran out' END,
    lease_worker = :worker, lease_expires_at = :expires_at
FROM candidates
WHERE j.reconstruction_id = candidates.reconstruction_id AND j.sequence = candidates.sequence
RETURNING j.reconstruction_id, j.sequence, j.camera, j.snapshot, j.state, j.epoch, j.filtered_digest, j.weak_targets,
          j.report_json, j.set_aside_reason, j.memory_bytes, j.failed_attempts, j.out_of_memory_failures,
          j.last_failure, j.not_before, j.lease_worker, j.lease_expires_at;
