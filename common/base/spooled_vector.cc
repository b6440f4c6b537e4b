// SPDX-License-Identifier: Apache-2.0
#include "common/base/spooled_vector.h"

#include <cstring>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "common/base/nameless_file.h"

namespace meshwright {
namespace {

constexpr size_t kLeastBytes = size_t{64} << 10;

}  // namespace

SpooledBytes::SpooledBytes(SpooledBytes&& other) noexcept
    : beside_(std::move(other.beside_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      data_(std::exchange(other.data_, nullptr)),
      capacity_(std::exchange(other.capacity_, 0)) {}

SpooledBytes& SpooledBytes::operator=(SpooledBytes&& other) noexcept {
  std::swap(beside_, other.beside_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(data_, other.data_);
  std::swap(capacity_, other.capacity_);
  return *this;
}

SpooledBytes::~SpooledBytes() {
  if (data_ != nullptr) ::munmap(data_, capacity_);
  if (descriptor_ >= 0) ::close(descriptor_);
}

// False when there is no room; then everything is as before.
bool SpooledBytes::GrowFile(size_t bytes) {
  if (descriptor_ < 0) {
    if (beside_.empty() || data_ != nullptr) return false;
    const absl::StatusOr<int> created = CreateNamelessFile(beside_);
    if (!created.ok()) return false;
    descriptor_ = *created;
  }
  // A page without a block behind it would end the process when the disk is full.
  if (::posix_fallocate(descriptor_, 0, static_cast<off_t>(bytes)) != 0) return false;
  void* at = data_ == nullptr ? ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0)
                              : ::mremap(data_, capacity_, bytes, MREMAP_MAYMOVE);
  if (at == MAP_FAILED) return false;
  data_ = at;
  capacity_ = bytes;
  return true;
}

void SpooledBytes::Grow(size_t bytes) {
  bytes = std::max({bytes, capacity_ + capacity_ / 4, kLeastBytes});
  bytes = (bytes + kLeastBytes - 1) / kLeastBytes * kLeastBytes;
  if (GrowFile(bytes)) return;
  void* at = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (at == MAP_FAILED) throw std::bad_alloc();
  if (data_ != nullptr) {
    std::memcpy(at, data_, capacity_);
    ::munmap(data_, capacity_);
  }
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
  data_ = at;
  capacity_ = bytes;
}

void SpooledBytes::Release() const {
  // Of a shared file nothing is lost; of memory all would be.
  if (!in_memory() && data_ != nullptr) ::madvise(data_, capacity_, MADV_DONTNEED);
}

}  // namespace meshwright
