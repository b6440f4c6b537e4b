// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "common/base/status_macros.h"

namespace meshwright {

// Bytes, 0 at first, of a nameless file that is mapped: the system writes them out when memory is short, and they go
// with the process, however it ends. `beside`: the file is made in its folder.
absl::StatusOr<std::shared_ptr<void>> MapScratch(size_t bytes, const std::string& beside);

// An array that may be larger than the memory.
template <typename T>
class ScratchArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  // ResourceExhausted when the disk has no room for it.
  static absl::StatusOr<ScratchArray> Create(size_t count, const std::string& beside) {
    MW_ASSIGN_OR_RETURN(std::shared_ptr<void> bytes, MapScratch(count * sizeof(T), beside));
    return ScratchArray(std::move(bytes), count);
  }

  absl::Span<T> values() { return absl::MakeSpan(static_cast<T*>(bytes_.get()), count_); }
  absl::Span<const T> values() const { return absl::MakeConstSpan(static_cast<const T*>(bytes_.get()), count_); }

 private:
  ScratchArray(std::shared_ptr<void> bytes, size_t count) : bytes_(std::move(bytes)), count_(count) {}
  std::shared_ptr<void> bytes_;
  size_t count_;
};

}  // namespace meshwright
