// SPDX-License-Identifier: Apache-2.0
#include "common/base/method_version.h"

namespace meshwright {

const int kMethodVersion = 9;

}  // namespace meshwright
