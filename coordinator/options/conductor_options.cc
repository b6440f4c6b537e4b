// SPDX-License-Identifier: Apache-2.0
#include "coordinator/options/conductor_options.h"

#include "common/base/out_of_range.h"
#include "common/base/status_macros.h"

namespace meshwright {

absl::Status ConductorOptions::Validate() const {
  MW_RETURN_IF_ERROR(pairs.Validate());
  MW_RETURN_IF_ERROR(overlap.Validate());
  MW_RETURN_IF_ERROR(targets.Validate());
  MW_RETURN_IF_ERROR(acceptance.Validate());
  if (max_surfaces < 1) return OutOfRange("max_surfaces", max_surfaces, ">= 1");
  return ScheduleOptions{.window = window, .max_overlap_in_flight = acceptance.k_a}.Validate();
}

}  // namespace meshwright
