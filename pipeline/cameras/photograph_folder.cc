// SPDX-License-Identifier: Apache-2.0
#include "pipeline/cameras/photograph_folder.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <system_error>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/bad_input.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

constexpr size_t kFewestPhotographs = 3;
constexpr char kMasks[] = "masks";

std::string Extension(const fs::path& path) { return absl::AsciiStrToLower(path.extension().string()); }

bool IsPhotograph(const fs::path& path) {
  static const std::set<std::string> kExtensions = {".jpg", ".jpeg", ".png", ".pgm", ".ppm"};
  return kExtensions.count(Extension(path)) > 0;
}

// Kinds that people have and we do not read, with the way out.
std::string HowToConvert(const fs::path& path) {
  static const std::map<std::string, std::string> kWays = [] {
    std::map<std::string, std::string> ways;
    for (const char* heif : {".heic", ".heif"}) ways[heif] = "HEIC: convert with heif-convert IN.heic OUT.jpg";
    for (const char* raw : {".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2"}) {
      ways[raw] = "raw: develop to JPEG or PNG, for example with darktable-cli";
    }
    for (const char* tiff : {".tif", ".tiff"}) ways[tiff] = "TIFF: convert to PNG with ImageMagick";
    for (const char* other : {".webp", ".bmp", ".gif", ".avif", ".jp2"}) {
      ways[other] = "WebP, BMP and the like: convert to PNG with ImageMagick";
    }
    for (const char* video : {".mp4", ".mov", ".avi", ".mkv", ".webm"}) {
      ways[video] = "video: take frames out with ffmpeg -i VIDEO -vf fps=2 frame-%05d.jpg";
    }
    return ways;
  }();
  const auto way = kWays.find(Extension(path));
  return way == kWays.end() ? "" : way->second;
}

// Digits count as numbers, so that frame9 comes before frame10; names that are equal then are compared by bytes.
bool NaturallyBefore(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  size_t i = 0;
  size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
      continue;
    }
    const auto number = [&](const std::string& text, size_t* at) {
      while (*at < text.size() && text[*at] == '0') ++*at;
      const size_t begin = *at;
      while (*at < text.size() && digit(text[*at])) ++*at;
      return text.substr(begin, *at - begin);
    };
    const std::string x = number(a, &i);
    const std::string y = number(b, &j);
    if (x.size() != y.size()) return x.size() < y.size();
    if (x != y) return x < y;
  }
  if ((i < a.size()) != (j < b.size())) return j < b.size();
  return a < b;
}

struct FolderContents {
  std::vector<std::string> photographs;  // relative
  std::map<std::string, int> not_read;   // the way out -> how many files
  std::vector<std::string> masks;        // relative to the masks' folder
  std::string masks_folder;              // "": none
};

absl::Status ListBelow(const fs::path& root, const std::function<bool(const fs::path& folder)>& enter,
                       const std::function<void(const fs::path& file)>& found) {
  std::error_code error;
  auto it = fs::recursive_directory_iterator(root, fs::directory_options::follow_directory_symlink, error);
  for (; !error && it != fs::recursive_directory_iterator(); it.increment(error)) {
    const bool hidden = it->path().filename().string().front() == '.';
    std::error_code ignored;
    if (it->is_directory(ignored)) {
      if (hidden || !enter(it->path()) || it.depth() > 8) it.disable_recursion_pending();
    } else if (!hidden && it->is_regular_file(ignored)) {
      found(it->path());
    }
  }
  if (error) return absl::PermissionDeniedError(absl::StrCat(root.string(), ": cannot be read: ", error.message()));
  return absl::OkStatus();
}

std::string FindMasksFolder(const fs::path& photographs) {
  std::error_code error;
  if (fs::is_directory(photographs / kMasks, error)) return (photographs / kMasks).string();
  const fs::path folder = photographs.has_filename() ? photographs : photographs.parent_path();
  const fs::path beside = folder.parent_path() / kMasks;
  if (folder.filename() == "images" && fs::is_directory(beside, error)) return beside.string();
  return "";
}

absl::StatusOr<FolderContents> ListContents(const fs::path& root) {
  FolderContents contents;
  MW_RETURN_IF_ERROR(ListBelow(
      root, [&](const fs::path& folder) { return folder != root / kMasks; },
      [&](const fs::path& file) {
        if (IsPhotograph(file)) {
          contents.photographs.push_back(file.lexically_relative(root).string());
        } else if (const std::string way = HowToConvert(file); !way.empty()) {
          ++contents.not_read[way];
        }
      }));
  std::sort(contents.photographs.begin(), contents.photographs.end(), NaturallyBefore);
  contents.masks_folder = FindMasksFolder(root);
  if (contents.masks_folder.empty()) return contents;
  MW_RETURN_IF_ERROR(ListBelow(
      contents.masks_folder, [](const fs::path&) { return true; },
      [&](const fs::path& file) {
        if (Extension(file) == ".png") {
          contents.masks.push_back(file.lexically_relative(contents.masks_folder).string());
        }
      }));
  std::sort(contents.masks.begin(), contents.masks.end());
  return contents;
}

// "a, b, c and 4 more".
std::string FirstNames(const std::vector<std::string>& names) {
  constexpr size_t kNamed = 3;
  std::vector<std::string> first(names.begin(), names.begin() + std::min(names.size(), kNamed));
  std::string text = absl::StrJoin(first, ", ");
  if (names.size() > kNamed) absl::StrAppend(&text, " and ", names.size() - kNamed, " more");
  return text;
}

void AssignMasks(const FolderContents& contents, PhotographFolder* folder) {
  std::set<std::string> unused(contents.masks.begin(), contents.masks.end());
  for (Photograph& photograph : folder->photographs) {
    const std::string with_extension = photograph.name + ".png";
    const std::string stem = fs::path(photograph.name).replace_extension(".png").string();
    for (const std::string& name : {with_extension, stem}) {
      if (!photograph.mask_path.empty() || !std::binary_search(contents.masks.begin(), contents.masks.end(), name)) {
        continue;
      }
      photograph.mask_path = (fs::path(contents.masks_folder) / name).string();
      unused.erase(name);
    }
  }
  if (!unused.empty()) {
    folder->notes.push_back(
        absl::StrCat(unused.size(), " masks belong to no photograph (a mask is called as its photograph, then .png): ",
                     FirstNames({unused.begin(), unused.end()})));
  }
}

absl::Status TooFew(const PhotographFolder& folder) {
  std::string message = absl::StrCat(folder.path, ": ", folder.photographs.size(),
                                     " photographs (JPEG, PNG, PGM, PPM); expected at least ", kFewestPhotographs,
                                     " that show the same thing from different places");
  for (const std::string& note : folder.notes) absl::StrAppend(&message, "; ", note);
  return BadInput(absl::InvalidArgumentError(message));
}

struct Checked {
  absl::Status photograph;
  absl::Status mask;
  std::string digest;  // of photograph and mask
};

absl::Status CheckMask(Photograph* photograph, std::string* digests) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(photograph->mask_path));
  MW_ASSIGN_OR_RETURN(const ImageSize mask, CheckImageBytes(bytes, photograph->mask_path));
  if (mask.width != photograph->size.width || mask.height != photograph->size.height) {
    return absl::InvalidArgumentError(absl::StrCat(photograph->mask_path, ": ", mask.width, " x ", mask.height,
                                                   " px; expected its photograph's ", photograph->size.width, " x ",
                                                   photograph->size.height));
  }
  absl::StrAppend(digests, Sha256Hex(bytes));
  return absl::OkStatus();
}

Checked CheckOne(Photograph* photograph) {
  Checked checked;
  const absl::StatusOr<std::string> bytes = ReadFile(photograph->path);
  if (!bytes.ok()) return {.photograph = bytes.status(), .mask = absl::OkStatus(), .digest = ""};
  const absl::StatusOr<ImageSize> image = CheckImageBytes(*bytes, photograph->path);
  if (!image.ok()) return {.photograph = image.status(), .mask = absl::OkStatus(), .digest = ""};
  photograph->size = *image;
  photograph->exif = ReadExifCamera(bytes->substr(0, size_t{1} << 17));
  checked.digest = Sha256Hex(*bytes);
  if (!photograph->mask_path.empty()) {
    checked.mask = CheckMask(photograph, &checked.digest);
    if (!checked.mask.ok()) photograph->mask_path.clear();
  }
  return checked;
}

}  // namespace

absl::StatusOr<PhotographFolder> ListPhotographs(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) {
    return BadInput(absl::NotFoundError(absl::StrCat(path, ": no such folder; expected a folder of photographs")));
  }
  const fs::path root = fs::path(path).lexically_normal();
  MW_ASSIGN_OR_RETURN(const FolderContents contents, ListContents(root));
  PhotographFolder folder{.path = path, .photographs = {}, .notes = {}, .digest = ""};
  for (const std::string& name : contents.photographs) {
    folder.photographs.push_back(
        {.name = name, .path = (root / name).string(), .mask_path = "", .size = {}, .exif = {}});
  }
  for (const auto& [way, files] : contents.not_read) {
    folder.notes.push_back(absl::StrCat(files, " files are of a kind that is not read (", way, ")"));
  }
  AssignMasks(contents, &folder);
  if (folder.photographs.size() < kFewestPhotographs) return TooFew(folder);
  return folder;
}

absl::Status CheckPhotographs(PhotographFolder* folder, ThreadPool& pool, const std::function<void(int n)>& checked) {
  std::vector<Checked> results(folder->photographs.size());
  std::mutex mutex;
  int done = 0;
  pool.ParallelFor(static_cast<int64_t>(results.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      results[i] = CheckOne(&folder->photographs[i]);
      const std::lock_guard lock(mutex);
      checked(++done);
    }
  });
  std::vector<Photograph> kept;
  Sha256Stream digest;
  const auto add = [&](const std::string& text) {
    digest.Update({reinterpret_cast<const uint8_t*>(text.data()), text.size() + 1});  // with its 0
  };
  for (size_t i = 0; i < results.size(); ++i) {
    Photograph& photograph = folder->photographs[i];
    if (!results[i].mask.ok()) folder->notes.push_back(absl::StrCat("mask left out: ", results[i].mask.message()));
    if (!results[i].photograph.ok()) {
      folder->notes.push_back(absl::StrCat("photograph left out: ", results[i].photograph.message()));
      continue;
    }
    add(photograph.name);
    add(results[i].digest);
    kept.push_back(std::move(photograph));
  }
  folder->photographs = std::move(kept);
  folder->digest = digest.HexDigest();
  if (folder->photographs.size() < kFewestPhotographs) return TooFew(*folder);
  return absl::OkStatus();
}

bool HoldsPhotographs(const std::string& path) {
  const absl::StatusOr<FolderContents> contents = ListContents(fs::path(path).lexically_normal());
  return contents.ok() && (!contents->photographs.empty() || !contents->not_read.empty());
}

}  // namespace meshwright
