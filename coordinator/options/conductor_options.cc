#include "coordinator/options/conductor_options.h"

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"

namespace meshwright {

absl::Status ConductorOptions::Validate() const {
  MW_RETURN_IF_ERROR(pairs.Validate());
  MW_RETURN_IF_ERROR(overlap.Validate());
  MW_RETURN_IF_ERROR(targets.Validate());
  MW_RETURN_IF_ERROR(acceptance.Validate());
  if (max_surfaces < 1) {
    return absl::InvalidArgumentError(absl::StrCat("max_surfaces is ", max_surfaces, ", expected >= 1"));
  }
  return ScheduleOptions{.window = window, .max_overlap_in_flight = acceptance.k_a}.Validate();
}

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
