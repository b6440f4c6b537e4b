// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/job/camera_job_spec.h"

namespace meshwright {

// What the store keeps of a CameraJobSpec, so that any coordinator can hand the job out: targets and accepted surfaces
// (sequence, camera, snapshot, epoch and neighbours have columns of their own), and what the job needs when it is made
// smaller 0, 1, 2 ... times, bytes.
struct StoredJobSpec {
  std::vector<CameraIndex> targets;
  std::vector<AcceptedSurface> accepted;
  std::vector<int64_t> memory_bytes;
};

std::string EncodeJobSpec(const StoredJobSpec& spec);
// DataLoss when it is not what EncodeJobSpec makes.
absl::StatusOr<StoredJobSpec> DecodeJobSpec(const std::string& json);

// A photograph, or a mask, whose camera is to be estimated.
struct StoredPhotograph {
  std::string path;    // relative, with "/"
  std::string digest;  // in the BlobStore

  bool operator==(const StoredPhotograph&) const = default;
};

// What the store keeps of the job that estimates cameras.
std::string EncodePhotographs(const std::vector<StoredPhotograph>& photographs);
absl::StatusOr<std::vector<StoredPhotograph>> DecodePhotographs(const std::string& json);

}  // namespace meshwright
