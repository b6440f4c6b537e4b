// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/zip_archive.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <absl/strings/str_cat.h>
#include <zlib.h>

#include "common/base/little_endian.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

constexpr int64_t kLargest32 = std::numeric_limits<uint32_t>::max();
constexpr size_t kLargest16 = std::numeric_limits<uint16_t>::max();
constexpr uint32_t kLocalHeader = 0x04034b50;
constexpr uint32_t kDirectoryHeader = 0x02014b50;
constexpr uint32_t kZip64End = 0x06064b50;
constexpr uint32_t kZip64Locator = 0x07064b50;
constexpr uint32_t kEnd = 0x06054b50;
constexpr uint16_t kVersion20 = 20;
constexpr uint16_t kVersion45 = 45;  // ZIP64
constexpr uint16_t kMadeByUnix = 3 << 8;
constexpr uint16_t kNamesAreUtf8 = 1 << 11;
constexpr uint16_t kFirstDay = (1 << 5) | 1;     // 1980-01-01, so that equal files give equal archives
constexpr uint32_t kPlainFile = 0100644U << 16;  // Unix' mode
constexpr uint16_t kZip64Extra = 1;
constexpr size_t kReadBytes = size_t{1} << 20;

class Writer {
 public:
  template <typename T>
  Writer& Put(T value) {
    char bytes[sizeof(T)];
    StoreLittleEndian(value, bytes);
    text_.append(bytes, sizeof(T));
    return *this;
  }
  Writer& Put16(uint16_t value) { return Put(value); }
  Writer& Put32(uint32_t value) { return Put(value); }
  Writer& Put64(int64_t value) { return Put(static_cast<uint64_t>(value)); }
  Writer& PutText(const std::string& text) {
    text_ += text;
    return *this;
  }
  std::string Take() { return std::move(text_); }

 private:
  std::string text_;
};

uint32_t In32(int64_t value) { return static_cast<uint32_t>(std::min(value, kLargest32)); }
bool IsLarge(int64_t value) { return value >= kLargest32; }

// What both headers of an entry have in common, from the flags on to the lengths.
void PutCommon(const ZipEntry& entry, size_t extra_bytes, Writer& to) {
  to.Put16(kNamesAreUtf8).Put16(0).Put16(0).Put16(kFirstDay);  // stored, at midnight
  to.Put32(entry.crc32).Put32(In32(entry.size_bytes)).Put32(In32(entry.size_bytes));
  to.Put16(static_cast<uint16_t>(entry.name.size())).Put16(static_cast<uint16_t>(extra_bytes));
}

std::string LocalHeader(const ZipEntry& entry) {
  const bool is_large = IsLarge(entry.size_bytes);
  Writer header;
  header.Put32(kLocalHeader).Put16(is_large ? kVersion45 : kVersion20);
  PutCommon(entry, is_large ? 20 : 0, header);
  header.PutText(entry.name);
  if (is_large) header.Put16(kZip64Extra).Put16(16).Put64(entry.size_bytes).Put64(entry.size_bytes);
  return header.Take();
}

std::string DirectoryHeader(const ZipEntry& entry, int64_t offset) {
  Writer extra;
  if (IsLarge(entry.size_bytes)) extra.Put64(entry.size_bytes).Put64(entry.size_bytes);
  if (IsLarge(offset)) extra.Put64(offset);
  std::string large = extra.Take();
  if (!large.empty()) {
    large = Writer().Put16(kZip64Extra).Put16(static_cast<uint16_t>(large.size())).PutText(large).Take();
  }
  const uint16_t version = large.empty() ? kVersion20 : kVersion45;
  Writer header;
  header.Put32(kDirectoryHeader).Put16(kMadeByUnix | version).Put16(version);
  PutCommon(entry, large.size(), header);
  header.Put16(0).Put16(0).Put16(0).Put32(kPlainFile).Put32(In32(offset)).PutText(entry.name).PutText(large);
  return header.Take();
}

std::string EndOfDirectory(size_t entries, int64_t begin, int64_t size_bytes) {
  Writer end;
  if (entries >= kLargest16 || IsLarge(begin) || IsLarge(size_bytes)) {
    end.Put32(kZip64End).Put64(44).Put16(kMadeByUnix | kVersion45).Put16(kVersion45).Put32(0).Put32(0);
    end.Put64(static_cast<int64_t>(entries)).Put64(static_cast<int64_t>(entries)).Put64(size_bytes).Put64(begin);
    end.Put32(kZip64Locator).Put32(0).Put64(begin + size_bytes).Put32(1);
  }
  const auto count = static_cast<uint16_t>(std::min(entries, kLargest16));
  end.Put32(kEnd).Put16(0).Put16(0).Put16(count).Put16(count).Put32(In32(size_bytes)).Put32(In32(begin)).Put16(0);
  return end.Take();
}

}  // namespace

absl::StatusOr<ZipEntry> MakeZipEntry(const std::string& name, const std::string& path) {
  MW_ASSIGN_OR_RETURN(const auto file, OpenedFile::Open(path));
  ZipEntry entry = {.name = name, .path = path, .size_bytes = file->size_bytes()};
  std::string piece(kReadBytes, '\0');
  uLong crc = ::crc32(0, nullptr, 0);
  for (int64_t at = 0; at < entry.size_bytes;) {
    MW_ASSIGN_OR_RETURN(const size_t got, file->Read(at, piece.data(), piece.size()));
    crc = ::crc32(crc, reinterpret_cast<const Bytef*>(piece.data()), static_cast<uInt>(got));
    at += static_cast<int64_t>(got);
  }
  entry.crc32 = static_cast<uint32_t>(crc);
  return entry;
}

absl::StatusOr<std::shared_ptr<const ZipArchive>> ZipArchive::Open(const std::vector<ZipEntry>& entries) {
  auto archive = std::make_shared<ZipArchive>();
  std::string directory;
  for (const ZipEntry& entry : entries) {
    MW_ASSIGN_OR_RETURN(auto file, OpenedFile::Open(entry.path));
    if (file->size_bytes() != entry.size_bytes) {
      return absl::DataLossError(
          absl::StrCat(entry.name, " has ", file->size_bytes(), " bytes, expected ", entry.size_bytes));
    }
    directory += DirectoryHeader(entry, archive->size_bytes_);
    archive->Add(LocalHeader(entry));
    if (entry.size_bytes == 0) continue;
    archive->segments_.push_back(
        {.begin = archive->size_bytes_, .size_bytes = entry.size_bytes, .file = std::move(file)});
    archive->size_bytes_ += entry.size_bytes;
  }
  const auto directory_bytes = static_cast<int64_t>(directory.size());
  archive->Add(directory + EndOfDirectory(entries.size(), archive->size_bytes_, directory_bytes));
  return archive;
}

void ZipArchive::Add(std::string bytes) {
  const auto size_bytes = static_cast<int64_t>(bytes.size());
  segments_.push_back({.begin = size_bytes_, .size_bytes = size_bytes, .bytes = std::move(bytes)});
  size_bytes_ += size_bytes;
}

absl::StatusOr<std::string> ZipArchive::Read(int64_t offset, size_t most) const {
  std::string piece;
  auto segment = std::upper_bound(segments_.begin(), segments_.end(), offset,
                                  [](int64_t at, const Segment& other) { return at < other.begin; });
  for (--segment; segment != segments_.end() && piece.size() < most; ++segment) {
    const int64_t at = offset + static_cast<int64_t>(piece.size()) - segment->begin;
    const auto count =
        static_cast<size_t>(std::min<int64_t>(segment->size_bytes - at, static_cast<int64_t>(most - piece.size())));
    if (segment->file == nullptr) {
      piece.append(segment->bytes, static_cast<size_t>(at), count);
      continue;
    }
    const size_t before = piece.size();
    piece.resize(before + count);
    MW_ASSIGN_OR_RETURN(const size_t got, segment->file->Read(at, &piece[before], count));
    piece.resize(before + got);
    if (got < count) break;
  }
  return piece;
}

}  // namespace meshwright
