// SPDX-License-Identifier: Apache-2.0
// Programs of the version after this one, for upgrades in tests: linked in place of common/base/version.cc and
// method_version.cc.

#include <cstdlib>

#include "common/base/method_version.h"
#include "common/base/version.h"

namespace meshwright {

const char* const kProgramVersion = "99.0.0";

// Who starts it says whether it is another method.
const int kMethodVersion = std::atoi(std::getenv("NEXT_METHOD_VERSION"));

}  // namespace meshwright
