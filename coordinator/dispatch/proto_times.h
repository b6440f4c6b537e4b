// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <absl/time/time.h>
#include <google/protobuf/timestamp.pb.h>

namespace meshwright {

inline void FillTime(absl::Time time, google::protobuf::Timestamp& timestamp) {
  const int64_t microseconds = absl::ToUnixMicros(time);
  timestamp.set_seconds(microseconds / 1'000'000);
  timestamp.set_nanos(static_cast<int32_t>(microseconds % 1'000'000) * 1000);
}

}  // namespace meshwright
