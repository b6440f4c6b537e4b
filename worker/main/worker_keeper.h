// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <absl/status/statusor.h>

namespace meshwright {

// How many processes the kernel has killed since memory ran out: those of this control group where it is known, else of
// the whole machine. NotFound where the kernel does not tell.
absl::StatusOr<int64_t> CountOutOfMemoryKills();

// Runs `work` in a child process, and again when the kernel has killed that since memory ran out; `work` is told so.
// A process that is killed so cannot say it, and who kills it otherwise means something else. Signals to stop are
// passed on, and the child does not outlive this process. Returns the exit code of the last child. To be called before
// there are threads, with stop signals blocked.
int KeepAlive(const std::function<int(bool ran_out_of_memory)>& work);

}  // namespace meshwright
