// SPDX-License-Identifier: Apache-2.0
#include "common/base/version.h"

namespace meshwright {

const char* const kProgramVersion = MW_VERSION;

}  // namespace meshwright
