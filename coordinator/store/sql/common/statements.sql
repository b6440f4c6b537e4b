-- SPDX-License-Identifier: Apache-2.0
-- The statements of the store, for SQLite and PostgreSQL. What stands in "/*postgres: ... */" is a comment for SQLite,
-- where only one process writes at a time and nothing needs a lock of its own.
--
-- FOR SHARE of the conductor's lease: nobody takes over between this check and the end of the transaction, so the next
-- conductor sees what was written.

-- name: take_reconstruction_id
INSERT INTO reconstruction_ids (id) VALUES (:id);

-- name: create_reconstruction
INSERT INTO reconstructions (id, options_json, scene_digest, state, created_at, state_reason, weight_thousandths,
                             scene_reference, owner, method_version)
VALUES (:id, :options_json, :scene_digest, :state, :now, :reason, :weight_thousandths, :scene_reference, :owner,
        :method_version);

-- name: get_reconstruction
SELECT id, options_json, scene_digest, state, state_reason, weight_thousandths, scene_reference, scene_blob, created_at,
       finished_at, mesh_digest, mesh_bytes, vertices, faces, cameras_total, cameras_committed, cameras_set_aside,
       cameras_in_flight, patches_filtered, patches_accepted, owner, method_version, joined_thousandths,
       expected_end_at, verdict_json
FROM reconstructions WHERE id = :id;

-- name: list_reconstructions
SELECT id, options_json, scene_digest, state, state_reason, weight_thousandths, scene_reference, scene_blob, created_at,
       finished_at, mesh_digest, mesh_bytes, vertices, faces, cameras_total, cameras_committed, cameras_set_aside,
       cameras_in_flight, patches_filtered, patches_accepted, owner, method_version, joined_thousandths,
       expected_end_at, verdict_json
FROM reconstructions WHERE id > :after AND state <> 'deleting' ORDER BY id LIMIT :limit;

-- name: list_reconstructions_of
SELECT id, options_json, scene_digest, state, state_reason, weight_thousandths, scene_reference, scene_blob, created_at,
       finished_at, mesh_digest, mesh_bytes, vertices, faces, cameras_total, cameras_committed, cameras_set_aside,
       cameras_in_flight, patches_filtered, patches_accepted, owner, method_version, joined_thousandths,
       expected_end_at, verdict_json
FROM reconstructions WHERE owner = :owner AND id > :after AND state <> 'deleting' ORDER BY id LIMIT :limit;

-- name: usage_of
SELECT (SELECT count(*) FROM reconstructions WHERE owner = :owner AND state <> 'deleting'),
       (SELECT coalesce(sum(f.size_bytes), 0) FROM scene_files AS f JOIN reconstructions AS r ON r.id = f.reconstruction_id
        WHERE r.owner = :owner AND r.state <> 'deleting');

-- name: set_reconstruction_scene
UPDATE reconstructions SET scene_digest = :scene_digest, scene_blob = :scene_blob
WHERE id = :id AND state IN ('created', 'preparing')
  AND EXISTS (SELECT 1 FROM conductor_leases
              WHERE reconstruction_id = :id AND epoch = :conductor_epoch /*postgres: FOR SHARE */);

-- name: request_reconstruction_state
UPDATE reconstructions
SET state = :state, state_reason = '',
    finished_at = CASE WHEN CAST(:is_final AS INTEGER) = 1 THEN CAST(:now AS BIGINT) ELSE finished_at END
WHERE id = :id AND state NOT IN ('done', 'cancelled', 'failed', 'deleting');

-- name: set_reconstruction_state
UPDATE reconstructions
SET state = :state, state_reason = :reason,
    finished_at = CASE WHEN CAST(:is_final AS INTEGER) = 1 THEN CAST(:now AS BIGINT) ELSE finished_at END
WHERE id = :id AND state NOT IN ('done', 'cancelled', 'failed', 'deleting')
  AND EXISTS (SELECT 1 FROM conductor_leases
              WHERE reconstruction_id = :id AND epoch = :conductor_epoch /*postgres: FOR SHARE */);

-- name: finish_reconstruction
UPDATE reconstructions
SET state = 'done', finished_at = :now, mesh_digest = :mesh_digest, mesh_bytes = :mesh_bytes, vertices = :vertices,
    faces = :faces, verdict_json = :verdict_json
WHERE id = :id AND state NOT IN ('done', 'cancelled', 'failed', 'deleting')
  AND EXISTS (SELECT 1 FROM conductor_leases
              WHERE reconstruction_id = :id AND epoch = :conductor_epoch /*postgres: FOR SHARE */);

-- name: set_progress
UPDATE reconstructions
SET cameras_total = :cameras_total, cameras_committed = :cameras_committed, cameras_set_aside = :cameras_set_aside,
    cameras_in_flight = :cameras_in_flight, patches_filtered = :patches_filtered, patches_accepted = :patches_accepted,
    joined_thousandths = :joined_thousandths, expected_end_at = :expected_end
WHERE id = :id
  AND EXISTS (SELECT 1 FROM conductor_leases
              WHERE reconstruction_id = :id AND epoch = :conductor_epoch /*postgres: FOR SHARE */);

-- name: begin_deletion
UPDATE reconstructions SET state = 'deleting' WHERE id = :id AND state <> 'deleting';

-- name: delete_reconstruction
DELETE FROM reconstructions WHERE id = :id;

-- name: assign_camera_job
INSERT INTO camera_jobs (reconstruction_id, sequence, camera, snapshot, assigned_at, memory_bytes, neighbours, spec)
SELECT CAST(:id AS TEXT), CAST(:sequence AS INTEGER), CAST(:camera AS INTEGER), CAST(:snapshot AS INTEGER),
       CAST(:now AS BIGINT), CAST(:memory_bytes AS BIGINT), CAST(:neighbours AS TEXT), CAST(:spec AS TEXT)
WHERE EXISTS (SELECT 1 FROM conductor_leases
              WHERE reconstruction_id = :id AND epoch = :conductor_epoch /*postgres: FOR SHARE */)
ON CONFLICT DO NOTHING;

-- name: complete_camera_job
UPDATE camera_jobs
SET state = 'done', filtered_digest = :filtered_digest, weak_targets = :weak_targets, report_json = :report_json,
    finished_at = :now, last_ending = 'finished', last_ended_at = :now, expected_digest = NULL,
    lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND (expected_digest IS NULL OR expected_digest = :filtered_digest);

-- name: set_camera_job_aside
UPDATE camera_jobs
SET state = 'set_aside', set_aside_reason = :reason, finished_at = :now, last_ending = :ending, last_ended_at = :now,
    lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND expected_digest IS NULL;

-- name: reopen_camera_job
UPDATE camera_jobs
SET state = 'assigned', epoch = epoch + 1, expected_digest = :expected_digest, filtered_digest = NULL,
    report_json = NULL, finished_at = NULL, last_failure = :reason, not_before = :retry_at,
    failed_attempts = CASE WHEN CAST(:expected_digest AS TEXT) IS NULL THEN failed_attempts + 1 ELSE 0 END,
    out_of_memory_failures = CASE WHEN CAST(:expected_digest AS TEXT) IS NULL THEN out_of_memory_failures ELSE 0 END,
    losses = CASE WHEN CAST(:expected_digest AS TEXT) IS NULL THEN losses ELSE 0 END
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'done'
  AND EXISTS (SELECT 1 FROM conductor_leases
              WHERE reconstruction_id = :id AND epoch = :conductor_epoch /*postgres: FOR SHARE */);

-- name: get_camera_job
SELECT reconstruction_id, sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json,
       set_aside_reason, memory_bytes, failed_attempts, out_of_memory_failures, last_failure, not_before,
       lease_worker, lease_expires_at, losses, reduction, expected_digest, neighbours, lease_instance, leased_at, spec
FROM camera_jobs WHERE reconstruction_id = :id AND sequence = :sequence;

-- name: list_camera_jobs
SELECT reconstruction_id, sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json,
       set_aside_reason, memory_bytes, failed_attempts, out_of_memory_failures, last_failure, not_before,
       lease_worker, lease_expires_at, losses, reduction, expected_digest, neighbours, lease_instance, leased_at
FROM camera_jobs WHERE reconstruction_id = :id AND sequence > :after AND sequence < 2147483646 ORDER BY sequence;

-- name: list_outcomes
SELECT sequence, state, epoch, filtered_digest, weak_targets
FROM camera_jobs
WHERE reconstruction_id = :id AND sequence > :after AND sequence < 2147483646 AND state <> 'assigned' ORDER BY sequence;

-- name: list_open_jobs
SELECT j.reconstruction_id, j.sequence, j.camera, j.epoch, j.memory_bytes, j.failed_attempts, j.losses, j.reduction,
       j.not_before, j.lease_worker, j.lease_instance, j.leased_at, j.lease_expires_at, r.weight_thousandths,
       CASE WHEN j.expected_digest IS NULL THEN 0 ELSE 1 END, r.method_version
FROM camera_jobs AS j JOIN reconstructions AS r ON r.id = j.reconstruction_id
WHERE j.state = 'assigned'
  AND (r.state IN ('running', 'joining') OR (r.state = 'preparing' AND j.sequence >= 2147483646))
ORDER BY j.reconstruction_id, j.sequence;

-- name: claim_camera_job
UPDATE camera_jobs
SET epoch = epoch + 1, lease_worker = :worker, lease_instance = :instance, leased_at = :now,
    lease_expires_at = :expires_at
WHERE (reconstruction_id, sequence) IN (
  SELECT reconstruction_id, sequence FROM camera_jobs
  WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
    AND lease_worker IS NULL /*postgres: FOR UPDATE SKIP LOCKED */)
RETURNING reconstruction_id, sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json,
          set_aside_reason, memory_bytes, failed_attempts, out_of_memory_failures, last_failure, not_before,
          lease_worker, lease_expires_at, losses, reduction, expected_digest, neighbours, lease_instance, leased_at,
          spec;

-- name: renew_lease
UPDATE camera_jobs SET lease_expires_at = :expires_at
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND lease_worker = :worker;

-- name: release_lease
UPDATE camera_jobs
SET not_before = :retry_at, last_ending = 'given_back', last_ended_at = :now, lease_worker = NULL,
    lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND lease_worker = :worker;

-- name: fail_lease
UPDATE camera_jobs
SET failed_attempts = failed_attempts + 1, out_of_memory_failures = out_of_memory_failures + :out_of_memory,
    reduction = reduction + :reductions,
    memory_bytes = CASE WHEN CAST(:memory_bytes AS BIGINT) < 0 THEN memory_bytes ELSE :memory_bytes END,
    last_failure = :reason, not_before = :retry_at,
    last_ending = CASE WHEN CAST(:out_of_memory AS BIGINT) = 1 THEN 'out_of_memory' ELSE 'failed' END,
    last_ended_at = :now, lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND lease_worker = :worker;

-- name: expire_lease
UPDATE camera_jobs
SET losses = losses + 1, last_failure = :reason, not_before = :retry_at, last_ending = 'lost', last_ended_at = :now,
    lease_worker = NULL, lease_expires_at = NULL
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned'
  AND lease_worker = :worker AND lease_expires_at <= :expired_at;

-- name: list_attempts
SELECT sequence, camera, epoch, worker, began_at, ended_at, ending, reason
FROM attempts WHERE reconstruction_id = :id ORDER BY began_at DESC, sequence DESC LIMIT :limit;

-- name: add_commit
INSERT INTO commits (reconstruction_id, sequence, camera, accepted_digest, filtered_patches, accepted_patches,
                     committed_at)
SELECT CAST(:id AS TEXT), CAST(:sequence AS INTEGER), CAST(:camera AS INTEGER), CAST(:accepted_digest AS TEXT),
       CAST(:filtered_patches AS BIGINT), CAST(:accepted_patches AS BIGINT), CAST(:now AS BIGINT)
WHERE NOT EXISTS (SELECT 1 FROM commits WHERE reconstruction_id = :id AND sequence = :sequence)
  AND EXISTS (SELECT 1 FROM conductor_leases
              WHERE reconstruction_id = :id AND epoch = :conductor_epoch /*postgres: FOR SHARE */)
ON CONFLICT DO NOTHING;

-- name: get_commit
SELECT sequence, camera, accepted_digest, filtered_patches, accepted_patches
FROM commits WHERE reconstruction_id = :id AND sequence = :sequence;

-- name: list_commits
SELECT sequence, camera, accepted_digest, filtered_patches, accepted_patches
FROM commits WHERE reconstruction_id = :id AND sequence > :after ORDER BY sequence LIMIT :limit;

-- name: acquire_conductor_lease
INSERT INTO conductor_leases AS held (reconstruction_id, owner, epoch, expires_at)
SELECT id, CAST(:owner AS TEXT), 1, CAST(:expires_at AS BIGINT) FROM reconstructions WHERE id = :id
ON CONFLICT (reconstruction_id) DO UPDATE
SET owner = excluded.owner, epoch = held.epoch + 1, expires_at = excluded.expires_at
WHERE held.expires_at <= :lapsed_by OR held.owner = excluded.owner
RETURNING epoch;

-- name: renew_conductor_lease
UPDATE conductor_leases SET expires_at = :expires_at WHERE reconstruction_id = :id AND epoch = :epoch;

-- name: release_conductor_lease
UPDATE conductor_leases SET expires_at = :now WHERE reconstruction_id = :id AND epoch = :epoch;

-- name: get_conductor_lease
SELECT owner, epoch, expires_at FROM conductor_leases WHERE reconstruction_id = :id;

-- name: list_conducted
SELECT r.id, r.state, c.owner, c.epoch, c.expires_at, r.method_version
FROM reconstructions AS r LEFT JOIN conductor_leases AS c ON c.reconstruction_id = r.id
WHERE r.state IN ('preparing', 'running', 'joining', 'deleting')
ORDER BY r.id;

-- name: record_heartbeat
INSERT INTO workers (id, cores, memory_bytes, last_heartbeat, instance, version, draining, method_version,
                     colmap_version, owner)
VALUES (:worker, :cores, :memory_bytes, :now, :instance, :version, :draining, :method_version,
        :colmap_version, :owner)
ON CONFLICT (id) DO UPDATE
SET cores = excluded.cores, memory_bytes = excluded.memory_bytes, last_heartbeat = excluded.last_heartbeat,
    drained = CASE WHEN workers.instance = excluded.instance THEN workers.drained ELSE 0 END,
    instance = excluded.instance, version = excluded.version, draining = excluded.draining,
    method_version = excluded.method_version, colmap_version = excluded.colmap_version, owner = excluded.owner;

-- name: set_worker_drained
UPDATE workers SET drained = :drained WHERE id = :worker;

-- name: list_workers
SELECT id, cores, memory_bytes, last_heartbeat, drained, instance, version, draining, method_version,
       colmap_version, owner
FROM workers ORDER BY id;

-- name: remove_silent_workers
DELETE FROM workers WHERE last_heartbeat < :before
  AND NOT EXISTS (SELECT 1 FROM camera_jobs WHERE state = 'assigned' AND lease_worker = workers.id);

-- name: put_scene_file
INSERT INTO scene_files (reconstruction_id, path, size_bytes, digest)
VALUES (:id, :path, :size_bytes, :digest)
ON CONFLICT (reconstruction_id, path) DO UPDATE SET size_bytes = excluded.size_bytes, digest = excluded.digest;

-- name: list_scene_files
SELECT path, size_bytes, digest FROM scene_files WHERE reconstruction_id = :id ORDER BY path;

-- name: hold_blob
INSERT INTO held_blobs (reconstruction_id, digest) SELECT id, CAST(:digest AS TEXT) FROM reconstructions WHERE id = :id
ON CONFLICT DO NOTHING;

-- name: is_blob_vanishing
SELECT 1 FROM vanishing_blobs WHERE digest = :digest LIMIT 1;

-- name: let_blobs_vanish
INSERT INTO vanishing_blobs (reconstruction_id, digest)
SELECT CAST(:id AS TEXT), mine.digest FROM (
  SELECT digest FROM held_blobs WHERE reconstruction_id = :id
  UNION SELECT filtered_digest FROM camera_jobs WHERE reconstruction_id = :id AND filtered_digest IS NOT NULL
  UNION SELECT expected_digest FROM camera_jobs WHERE reconstruction_id = :id AND expected_digest IS NOT NULL
  UNION SELECT accepted_digest FROM commits WHERE reconstruction_id = :id AND accepted_digest IS NOT NULL) AS mine
WHERE CAST(:id AS TEXT) <> ''
ON CONFLICT DO NOTHING;

-- name: list_vanishing_blobs
SELECT v.digest FROM vanishing_blobs AS v
WHERE v.reconstruction_id = :id
  AND NOT EXISTS (SELECT 1 FROM held_blobs AS h JOIN reconstructions AS r ON r.id = h.reconstruction_id
                  WHERE h.digest = v.digest AND r.state <> 'deleting')
  AND NOT EXISTS (SELECT 1 FROM camera_jobs AS j JOIN reconstructions AS r ON r.id = j.reconstruction_id
                  WHERE j.filtered_digest = v.digest AND r.state <> 'deleting')
  AND NOT EXISTS (SELECT 1 FROM commits AS c JOIN reconstructions AS r ON r.id = c.reconstruction_id
                  WHERE c.accepted_digest = v.digest AND r.state <> 'deleting')
ORDER BY v.digest;

-- name: report_damaged_blob
INSERT INTO damaged_blobs (reconstruction_id, digest) SELECT id, CAST(:digest AS TEXT) FROM reconstructions WHERE id = :id
ON CONFLICT DO NOTHING;

-- name: list_damaged_blobs
SELECT digest FROM damaged_blobs WHERE reconstruction_id = :id ORDER BY digest;

-- name: forget_damaged_blob
DELETE FROM damaged_blobs WHERE reconstruction_id = :id AND digest = :digest;

-- name: count_assigned_camera_jobs
SELECT count(*) FROM camera_jobs AS j JOIN reconstructions AS r ON r.id = j.reconstruction_id
WHERE j.state = 'assigned'
  AND (r.state IN ('running', 'joining') OR (r.state = 'preparing' AND j.sequence >= 2147483646));

-- name: count_reconstructions
SELECT state, count(*) FROM reconstructions GROUP BY state;

-- name: oldest_progress
SELECT min(progress.at)
FROM (SELECT coalesce((SELECT c.committed_at FROM commits AS c WHERE c.reconstruction_id = r.id
                       ORDER BY c.sequence DESC LIMIT 1), r.created_at) AS at
      FROM reconstructions AS r WHERE r.state = 'running') AS progress;

-- name: create_token
INSERT INTO access_tokens (id, digest, user_name, role, reconstruction_id, created_at, expires_at)
VALUES (:id, :digest, :user_name, :role, :reconstruction_id, :created_at, :expires_at);

-- name: get_token
SELECT id, digest, user_name, role, reconstruction_id, created_at, expires_at, revoked_at
FROM access_tokens WHERE id = :id;

-- name: list_tokens
SELECT id, digest, user_name, role, reconstruction_id, created_at, expires_at, revoked_at
FROM access_tokens ORDER BY created_at, id;

-- name: revoke_token
UPDATE access_tokens SET revoked_at = coalesce(revoked_at, CAST(:now AS BIGINT)) WHERE id = :id;

-- name: remove_dead_tokens
DELETE FROM access_tokens WHERE coalesce(revoked_at, expires_at) < CAST(:before AS BIGINT);
