-- Statements that mean the same in SQLite and PostgreSQL.

-- name: create_reconstruction
INSERT INTO reconstructions (id, options_json, scene_digest, state, created_at, state_reason, weight)
VALUES (:id, :options_json, :scene_digest, :state, :now, :reason, :weight);

-- name: get_reconstruction
SELECT id, options_json, scene_digest, state, state_reason, weight FROM reconstructions WHERE id = :id;

-- name: list_reconstructions
SELECT id, options_json, scene_digest, state, state_reason, weight
FROM reconstructions WHERE id > :after ORDER BY id LIMIT :limit;

-- name: set_reconstruction_scene
UPDATE reconstructions SET scene_digest = :scene_digest WHERE id = :id AND state = 'created';

-- name: delete_reconstruction
DELETE FROM reconstructions WHERE id = :id;

-- name: reassign_camera_job
UPDATE camera_jobs SET epoch = epoch + 1, assigned_at = :now, lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND state = 'assigned'
RETURNING epoch;

-- name: complete_camera_job
UPDATE camera_jobs
SET state = 'done', filtered_digest = :filtered_digest, weak_targets = :weak_targets, report_json = :report_json,
    finished_at = :now, lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned';

-- name: set_camera_job_aside
UPDATE camera_jobs
SET state = 'set_aside', set_aside_reason = :reason, finished_at = :now, lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned';

-- name: get_camera_job
SELECT reconstruction_id, sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json,
       set_aside_reason, memory_bytes, failed_attempts, out_of_memory_failures, last_failure, not_before,
       lease_worker, lease_expires_at
FROM camera_jobs WHERE reconstruction_id = :id AND sequence = :sequence;

-- name: list_camera_jobs
SELECT reconstruction_id, sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json,
       set_aside_reason, memory_bytes, failed_attempts, out_of_memory_failures, last_failure, not_before,
       lease_worker, lease_expires_at
FROM camera_jobs WHERE reconstruction_id = :id AND sequence > :after ORDER BY sequence;

-- name: list_expired_leases
SELECT reconstruction_id, sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json,
       set_aside_reason, memory_bytes, failed_attempts, out_of_memory_failures, last_failure, not_before,
       lease_worker, lease_expires_at
FROM camera_jobs WHERE state = 'assigned' AND lease_expires_at <= :now
ORDER BY reconstruction_id, sequence;

-- name: list_leases
SELECT reconstruction_id, sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json,
       set_aside_reason, memory_bytes, failed_attempts, out_of_memory_failures, last_failure, not_before,
       lease_worker, lease_expires_at
FROM camera_jobs WHERE state = 'assigned' AND lease_worker IS NOT NULL AND (:worker = '' OR lease_worker = :worker)
ORDER BY reconstruction_id, sequence;

-- name: renew_lease
UPDATE camera_jobs SET lease_expires_at = :expires_at
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND lease_worker = :worker;

-- name: release_lease
UPDATE camera_jobs SET lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND lease_worker = :worker;

-- name: fail_lease
UPDATE camera_jobs
SET failed_attempts = failed_attempts + 1, out_of_memory_failures = out_of_memory_failures + :out_of_memory,
    last_failure = :reason, not_before = :retry_at, lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND lease_worker = :worker;

-- name: expire_lease
UPDATE camera_jobs
SET failed_attempts = failed_attempts + 1, out_of_memory_failures = out_of_memory_failures + :out_of_memory,
    last_failure = :reason, not_before = :retry_at, lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND lease_expires_at <= :now;

-- name: get_commit
SELECT sequence, camera, accepted_digest, filtered_patches, accepted_patches
FROM commits WHERE reconstruction_id = :id AND sequence = :sequence;

-- name: list_commits
SELECT sequence, camera, accepted_digest, filtered_patches, accepted_patches
FROM commits WHERE reconstruction_id = :id AND sequence > :after ORDER BY sequence;

-- name: acquire_conductor_lease
INSERT INTO conductor_leases AS held (reconstruction_id, owner, epoch, expires_at)
SELECT id, CAST(:owner AS TEXT), 1, CAST(:expires_at AS BIGINT) FROM reconstructions WHERE id = :id
ON CONFLICT (reconstruction_id) DO UPDATE
SET owner = excluded.owner, epoch = held.epoch + 1, expires_at = excluded.expires_at
WHERE held.expires_at <= :now OR held.owner = excluded.owner
RETURNING epoch;

-- name: renew_conductor_lease
UPDATE conductor_leases SET expires_at = :expires_at WHERE reconstruction_id = :id AND epoch = :epoch;

-- name: release_conductor_lease
UPDATE conductor_leases SET expires_at = :now WHERE reconstruction_id = :id AND epoch = :epoch;

-- name: get_conductor_lease
SELECT owner, epoch, expires_at FROM conductor_leases WHERE reconstruction_id = :id;

-- name: list_unconducted_reconstructions
SELECT r.id FROM reconstructions AS r LEFT JOIN conductor_leases AS c ON c.reconstruction_id = r.id
WHERE r.state = 'running' AND (c.expires_at IS NULL OR c.expires_at <= :now)
ORDER BY r.id;

-- name: record_heartbeat
INSERT INTO workers (id, cores, memory_bytes, last_heartbeat) VALUES (:worker, :cores, :memory_bytes, :now)
ON CONFLICT (id) DO UPDATE
SET cores = excluded.cores, memory_bytes = excluded.memory_bytes, last_heartbeat = excluded.last_heartbeat;

-- name: set_worker_drained
UPDATE workers SET drained = :drained WHERE id = :worker;

-- name: list_workers
SELECT id, cores, memory_bytes, last_heartbeat, drained FROM workers ORDER BY id;

-- name: remove_worker
DELETE FROM workers WHERE id = :worker;

-- name: count_assigned_camera_jobs
SELECT count(*) FROM camera_jobs AS j JOIN reconstructions AS r ON r.id = j.reconstruction_id
WHERE j.state = 'assigned' AND r.state = 'running';

-- name: count_reconstructions
SELECT state, count(*) FROM reconstructions GROUP BY state;

-- name: oldest_progress
SELECT min(progress.at)
FROM (SELECT coalesce((SELECT c.committed_at FROM commits AS c WHERE c.reconstruction_id = r.id
                       ORDER BY c.sequence DESC LIMIT 1), r.created_at) AS at
      FROM reconstructions AS r WHERE r.state = 'running') AS progress;
