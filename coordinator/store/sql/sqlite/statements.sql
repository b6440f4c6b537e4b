-- name: create_reconstruction
INSERT INTO reconstructions (id, options_json, scene_digest, state, created_at)
VALUES (:id, :options_json, :scene_digest, :state, :now);

-- name: get_reconstruction
SELECT id, options_json, scene_digest, state FROM reconstructions WHERE id = :id;

-- name: list_reconstructions
SELECT id, options_json, scene_digest, state FROM reconstructions ORDER BY id;

-- name: set_reconstruction_state
UPDATE reconstructions SET state = :state WHERE id = :id;

-- name: assign_camera_job
INSERT INTO camera_jobs (reconstruction_id, sequence, camera, snapshot, assigned_at)
VALUES (:id, :sequence, :camera, :snapshot, :now);

-- name: reassign_camera_job
UPDATE camera_jobs SET epoch = epoch + 1, assigned_at = :now
WHERE reconstruction_id = :id AND sequence = :sequence AND state = 'assigned'
RETURNING epoch;

-- name: complete_camera_job
UPDATE camera_jobs
SET state = 'done', filtered_digest = :filtered_digest, weak_targets = :weak_targets, report_json = :report_json,
    finished_at = :now
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned';

-- name: set_camera_job_aside
UPDATE camera_jobs
SET state = 'set_aside', set_aside_reason = :reason, finished_at = :now
WHERE reconstruction_id = :id AND sequence = :sequence AND epoch = :epoch AND state = 'assigned';

-- name: get_camera_job
SELECT sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json, set_aside_reason
FROM camera_jobs WHERE reconstruction_id = :id AND sequence = :sequence;

-- name: list_camera_jobs
SELECT sequence, camera, snapshot, state, epoch, filtered_digest, weak_targets, report_json, set_aside_reason
FROM camera_jobs WHERE reconstruction_id = :id ORDER BY sequence;

-- name: add_commit
INSERT INTO commits (reconstruction_id, sequence, camera, accepted_digest, filtered_patches, accepted_patches,
                     committed_at)
VALUES (:id, :sequence, :camera, :accepted_digest, :filtered_patches, :accepted_patches, :now);

-- name: get_commit
SELECT sequence, camera, accepted_digest, filtered_patches, accepted_patches
FROM commits WHERE reconstruction_id = :id AND sequence = :sequence;

-- name: list_commits
SELECT sequence, camera, accepted_digest, filtered_patches, accepted_patches
FROM commits WHERE reconstruction_id = :id ORDER BY sequence;
