#include "common/base/method_version.h"

namespace meshwright {

const int kMethodVersion = 2;

}  // namespace meshwright
// SPDX-License-Identifier: Apache-2.0
