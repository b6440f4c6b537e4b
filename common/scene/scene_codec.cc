// SPDX-License-Identifier: Apache-2.0
#include "common/scene/scene_codec.h"

#include <cstdint>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/types/span.h>

#include "common/base/digest.h"
#include "common/base/little_endian.h"
#include "common/base/utf8.h"

namespace meshwright {
namespace {

constexpr char kMagic[] = "MWSCENE2";        // the last digit is the version
constexpr char kMagicBefore[] = "MWSCENE1";  // no offset, masks or region, fewer coefficients
constexpr size_t kMagicSize = 8;
constexpr size_t kDigestSize = 64;
constexpr int kLastModel = static_cast<int>(Lens::Model::kEucm);
constexpr size_t kCoefficientsBefore = 8;  // of a lens, in version 1

void AppendText(const std::string& text, std::string& out) {
  AppendLittleEndian(static_cast<uint32_t>(text.size()), out);
  out += text;
}

template <typename Values>
void AppendDoubles(const Values& values, std::string& out) {
  for (const double value : values) AppendLittleEndian(value, out);
}

void AppendView(const SceneView& view, std::string& out) {
  AppendText(view.name, out);
  AppendText(view.image_path, out);
  AppendText(view.mask_path, out);
  const Lens& lens = view.lens;
  AppendLittleEndian(static_cast<int32_t>(lens.model), out);
  AppendLittleEndian(static_cast<int32_t>(lens.width), out);
  AppendLittleEndian(static_cast<int32_t>(lens.height), out);
  for (const double value : {lens.fx, lens.fy, lens.cx, lens.cy, lens.skew}) AppendLittleEndian(value, out);
  AppendDoubles(lens.coefficients, out);
  AppendDoubles(view.cam_from_world.rotation.reshaped(), out);
  AppendDoubles(view.cam_from_world.translation, out);
}

// Reads past the end give zeros and are remembered.
class Reader {
 public:
  Reader(const char* begin, const char* end) : at_(begin), end_(end) {}

  template <typename T>
  T Next() {
    if (static_cast<size_t>(end_ - at_) < sizeof(T)) return Fail(T{});
    const T value = LoadLittleEndian<T>(at_);
    at_ += sizeof(T);
    return value;
  }
  // A number of things of at least `bytes_each` bytes that follow.
  size_t NextCount(size_t bytes_each) {
    const auto count = static_cast<size_t>(Next<uint32_t>());
    if (count > static_cast<size_t>(end_ - at_) / bytes_each) return Fail(size_t{0});
    return count;
  }
  std::string NextText() {
    const size_t size = NextCount(1);
    std::string text(at_, size);
    at_ += size;
    return text;
  }
  template <typename Values>
  void NextDoubles(Values&& values) {
    for (double& value : values) value = Next<double>();
  }
  bool ok() const { return ok_; }
  bool at_end() const { return at_ == end_; }

 private:
  template <typename T>
  T Fail(T value) {
    ok_ = false;
    at_ = end_;
    return value;
  }
  const char* at_;
  const char* end_;
  bool ok_ = true;
};

bool ReadView(Reader& reader, bool is_before, SceneView& view) {
  view.name = ToUtf8(reader.NextText());
  view.image_path = reader.NextText();
  if (!is_before) view.mask_path = reader.NextText();
  Lens& lens = view.lens;
  const auto model = reader.Next<int32_t>();
  if (model < 0 || model > kLastModel) return false;
  lens.model = static_cast<Lens::Model>(model);
  lens.width = reader.Next<int32_t>();
  lens.height = reader.Next<int32_t>();
  for (double* value : {&lens.fx, &lens.fy, &lens.cx, &lens.cy, &lens.skew}) *value = reader.Next<double>();
  reader.NextDoubles(absl::MakeSpan(lens.coefficients).first(is_before ? kCoefficientsBefore : 12));
  reader.NextDoubles(view.cam_from_world.rotation.reshaped());
  reader.NextDoubles(view.cam_from_world.translation);
  return lens.width > 0 && lens.height > 0;
}

bool ReadPoint(Reader& reader, size_t views, SparsePoint& point) {
  reader.NextDoubles(point.x_in_world);
  for (uint8_t& channel : point.rgb) channel = reader.Next<uint8_t>();
  const size_t seen_by = reader.NextCount(sizeof(CameraIndex));
  for (size_t i = 0; i < seen_by; ++i) {
    const auto camera = reader.Next<CameraIndex>();
    if (camera < 0 || static_cast<size_t>(camera) >= views) return false;
    point.seen_by.push_back(camera);
  }
  return true;
}

}  // namespace

std::string EncodeScene(const Scene& scene) {
  std::string out(kMagic, kMagicSize);
  AppendText(scene.format, out);
  AppendDoubles(scene.offset, out);
  AppendLittleEndian(static_cast<uint8_t>(scene.region.has_value() ? 1 : 0), out);
  if (scene.region.has_value()) {
    AppendDoubles(scene.region->center, out);
    AppendDoubles(scene.region->axes.reshaped(), out);
    AppendDoubles(scene.region->size, out);
  }
  AppendLittleEndian(static_cast<uint32_t>(scene.views.size()), out);
  for (const SceneView& view : scene.views) AppendView(view, out);
  AppendLittleEndian(static_cast<uint32_t>(scene.points.size()), out);
  for (const SparsePoint& point : scene.points) {
    AppendDoubles(point.x_in_world, out);
    for (const uint8_t channel : point.rgb) AppendLittleEndian(channel, out);
    AppendLittleEndian(static_cast<uint32_t>(point.seen_by.size()), out);
    for (const CameraIndex camera : point.seen_by) AppendLittleEndian(camera, out);
  }
  return out + Sha256Hex(out);
}

absl::StatusOr<Scene> DecodeScene(const std::string& bytes) {
  const bool is_before = bytes.compare(0, kMagicSize, kMagicBefore) == 0;
  const bool is_known = is_before || bytes.compare(0, kMagicSize, kMagic) == 0;
  if (bytes.size() < kMagicSize + kDigestSize || !is_known) {
    return absl::InvalidArgumentError(absl::StrCat("scene: not a scene of version 1 or 2 (", bytes.size(), " bytes)"));
  }
  const std::string body = bytes.substr(0, bytes.size() - kDigestSize);
  if (bytes.compare(body.size(), kDigestSize, Sha256Hex(body)) != 0) {
    return absl::InvalidArgumentError("scene: its bytes do not have its digest");
  }
  const absl::Status malformed = absl::InvalidArgumentError("scene: its parts do not fit together");
  Reader reader(body.data() + kMagicSize, body.data() + body.size());
  Scene scene;
  scene.format = reader.NextText();
  if (!is_before) {
    reader.NextDoubles(scene.offset);
    if (reader.Next<uint8_t>() != 0) {
      OrientedBox& region = scene.region.emplace();
      reader.NextDoubles(region.center);
      reader.NextDoubles(region.axes.reshaped());
      reader.NextDoubles(region.size);
    }
  }
  scene.views.resize(reader.NextCount(1));
  for (SceneView& view : scene.views) {
    if (!ReadView(reader, is_before, view)) return malformed;
  }
  scene.points.resize(reader.NextCount(1));
  for (SparsePoint& point : scene.points) {
    if (!ReadPoint(reader, scene.views.size(), point)) return malformed;
  }
  if (!reader.ok() || !reader.at_end()) return malformed;
  return scene;
}

}  // namespace meshwright
