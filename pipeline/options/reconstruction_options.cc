// SPDX-License-Identifier: Apache-2.0
#include "pipeline/options/reconstruction_options.h"

#include "pipeline/options/option_table.h"

#include "common/base/status_macros.h"

namespace meshwright {

absl::Status ReconstructionOptions::Validate() const {
  MW_RETURN_IF_ERROR(CheckOptions(*this, ""));
  // What is not in the table, and what the rooms of the algorithm rely on.
  MW_RETURN_IF_ERROR(job.Validate());
  MW_RETURN_IF_ERROR(join.Validate());
  return conductor.Validate();
}

}  // namespace meshwright
