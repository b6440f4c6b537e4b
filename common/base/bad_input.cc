// SPDX-License-Identifier: Apache-2.0
#include "common/base/bad_input.h"

#include <absl/strings/cord.h>

namespace meshwright {
namespace {

constexpr char kBadInputUrl[] = "meshwright/bad-input";

}  // namespace

absl::Status BadInput(absl::Status status) {
  if (!status.ok()) status.SetPayload(kBadInputUrl, absl::Cord());
  return status;
}

bool IsBadInput(const absl::Status& status) { return status.GetPayload(kBadInputUrl).has_value(); }

}  // namespace meshwright
