-- What SQLite says in its own way. Only one process writes at a time, so nothing needs a lock of its own.

-- name: set_reconstruction_state
UPDATE reconstructions SET state = :state, state_reason = :reason
WHERE id = :id AND state IN ('created', 'running')
  AND (:conductor_epoch = 0 OR EXISTS (SELECT 1 FROM conductor_leases
                                       WHERE reconstruction_id = :id AND epoch = :conductor_epoch));

-- name: assign_camera_job
INSERT INTO camera_jobs (reconstruction_id, sequence, camera, snapshot, assigned_at, memory_bytes)
SELECT :id, :sequence, :camera, :snapshot, :now, :memory_bytes
WHERE :conductor_epoch = 0 OR EXISTS (SELECT 1 FROM conductor_leases
                                      WHERE reconstruction_id = :id AND epoch = :conductor_epoch)
ON CONFLICT DO NOTHING;

-- name: add_commit
INSERT INTO commits (reconstruction_id, sequence, camera, accepted_digest, filtered_patches, accepted_patches,
                     committed_at)
SELECT :id, :sequence, :camera, :accepted_digest, :filtered_patches, :accepted_patches, :now
WHERE NOT EXISTS (SELECT 1 FROM commits WHERE reconstruction_id = :id AND sequence = :sequence)
  AND (:conductor_epoch = 0 OR EXISTS (SELECT 1 FROM conductor_leases
                                       WHERE reconstruction_id = :id AND epoch = :conductor_epoch));

-- name: lease_camera_jobs
UPDATE camera_jobs
SET epoch = epoch + 1, failed_attempts = failed_attempts + (lease_worker IS NOT NULL),
    last_failure = CASE WHEN lease_worker IS NULL THEN last_failure
                        ELSE 'the lease of worker ' || lease_worker || ' ran out' END,
    lease_worker = :worker, lease_expires_at = :expires_at
WHERE (reconstruction_id, sequence) IN (
  SELECT j.reconstruction_id, j.sequence
  FROM camera_jobs AS j
  JOIN reconstructions AS r ON r.id = j.reconstruction_id
  LEFT JOIN json_each(:reconstruction_ids) AS turn ON turn.value = j.reconstruction_id
  WHERE j.state = 'assigned' AND r.state = 'running'
    AND (j.lease_expires_at IS NULL OR j.lease_expires_at <= :now)
    AND j.not_before <= :now AND j.memory_bytes <= :memory_bytes
    AND (turn.key IS NOT NULL OR json_array_length(:reconstruction_ids) = 0)
  ORDER BY turn.key, j.sequence, j.reconstruction_id
  LIMIT :max_jobs)
RETURNING reconstruction_id, sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json,
          set_aside_reason, memory_bytes, failed_attempts, out_of_memory_failures, last_failure, not_before,
          lease_worker, lease_expires_at;
