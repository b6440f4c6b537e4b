// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

#include "meshwright/v1/reconstruction.pb.h"

#include "coordinator/store/job_store.h"

namespace meshwright {

v1::ReconstructionState ToProto(ReconstructionState state);
// "cancelled": as messages say it.
std::string InWords(v1::ReconstructionState state);
// All that the store knows of a reconstruction.
v1::Reconstruction ToProto(const Reconstruction& reconstruction);
v1::Attempt ToProto(const std::string& reconstruction, const Attempt& attempt);

// 1 to 64 characters of a-z, 0-9 and "-", a letter or digit first. InvalidArgument names the field `id`.
absl::Status ValidateReconstructionId(const std::string& id);

}  // namespace meshwright
