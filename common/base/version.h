// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace meshwright {

// The version of all programs and of the library, "major.minor.patch": project() in the top CMakeLists.txt.
extern const char* const kProgramVersion;

}  // namespace meshwright
