// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>
#include <new>
#include <string>
#include <type_traits>
#include <utility>

namespace meshwright {

// Bytes in a nameless file beside another one, mapped into memory: the system writes them out and takes their memory
// back when others need it. Where no file can be made or has no room to grow they stay in memory.
class SpooledBytes {
 public:
  // `beside`: the path that the file's name begins with, before it is nameless; empty: all stays in memory.
  explicit SpooledBytes(std::string beside) : beside_(std::move(beside)) {}
  SpooledBytes(SpooledBytes&& other) noexcept;
  SpooledBytes& operator=(SpooledBytes&& other) noexcept;
  SpooledBytes(const SpooledBytes&) = delete;
  ~SpooledBytes();

  void* data() const { return data_; }
  size_t capacity() const { return capacity_; }
  bool in_memory() const { return descriptor_ < 0; }
  // At least so many bytes from now on; what is there stays but may move. Throws std::bad_alloc.
  void Grow(size_t bytes);
  // Gives the memory back until the bytes are asked for again.
  void Release() const;

 private:
  bool GrowFile(size_t bytes);

  std::string beside_;
  int descriptor_ = -1;
  void* data_ = nullptr;
  size_t capacity_ = 0;
};

// A std::vector, as far as that is needed, whose elements are SpooledBytes.
template <typename T>
class SpooledVector {
  static_assert(std::is_trivially_destructible_v<T>);

 public:
  explicit SpooledVector(std::string beside = {}) : bytes_(std::move(beside)) {}
  SpooledVector(SpooledVector&& other) noexcept
      : bytes_(std::move(other.bytes_)), size_(std::exchange(other.size_, 0)) {}
  SpooledVector& operator=(SpooledVector&& other) noexcept {
    bytes_ = std::move(other.bytes_);
    size_ = std::exchange(other.size_, 0);
    return *this;
  }

  size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T* data() { return static_cast<T*>(bytes_.data()); }
  const T* data() const { return static_cast<const T*>(bytes_.data()); }
  T* begin() { return data(); }
  T* end() { return data() + size_; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size_; }
  T& operator[](size_t i) { return data()[i]; }
  const T& operator[](size_t i) const { return data()[i]; }
  T& back() { return data()[size_ - 1]; }

  // `value` must not be an element of this vector.
  void push_back(const T& value) {
    Reserve(size_ + 1);
    new (data() + size_) T(value);
    ++size_;
  }
  template <typename Range>
  void Append(const Range& values) {
    Reserve(size_ + static_cast<size_t>(std::size(values)));
    for (const T& value : values) push_back(value);
  }
  void assign(size_t size, const T& value) {
    Reserve(size);
    std::uninitialized_fill_n(data(), size, value);
    size_ = size;
  }
  // Leaves the first ones.
  void Shorten(size_t size) { size_ = std::min(size_, size); }
  void Release() const { bytes_.Release(); }

 private:
  void Reserve(size_t size) {
    if (size * sizeof(T) > bytes_.capacity()) bytes_.Grow(size * sizeof(T));
  }

  SpooledBytes bytes_;
  size_t size_ = 0;
};

}  // namespace meshwright
