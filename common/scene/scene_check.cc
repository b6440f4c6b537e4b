// SPDX-License-Identifier: Apache-2.0
#include "common/scene/scene_check.h"

#include <cstring>
#include <mutex>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/types/span.h>

#include "common/base/bad_input.h"
#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "common/image/decode.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

absl::StatusOr<std::string> CheckPhotograph(const SceneView& view) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(view.image_path));
  MW_ASSIGN_OR_RETURN(const ImageSize image, CheckImageBytes(bytes, view.image_path));
  if (image.width != view.lens.width || image.height != view.lens.height) {
    return absl::InvalidArgumentError(absl::StrCat(view.image_path, ": the picture is ", image.width, "x", image.height,
                                                   ", its camera expects ", view.lens.width, "x", view.lens.height));
  }
  std::string digest = Sha256Hex(bytes);
  if (view.mask_path.empty()) return digest;
  MW_ASSIGN_OR_RETURN(const std::string mask, ReadFile(view.mask_path));
  MW_RETURN_IF_ERROR(DecodeMask(view, mask).status());
  return digest + Sha256Hex(mask);
}

// Bytes of values in one agreed form: little-endian machines only, as everywhere here.
class ValueDigest {
 public:
  void Add(const std::string& text) {
    Add(static_cast<int64_t>(text.size()));
    Append(text.data(), text.size());
  }
  void Add(int64_t value) { Append(&value, sizeof(value)); }
  void Add(double value) { Append(&value, sizeof(value)); }
  std::string HexDigest() { return stream_.HexDigest(); }

 private:
  void Append(const void* data, size_t size) {
    stream_.Update(absl::MakeConstSpan(static_cast<const uint8_t*>(data), size));
  }
  Sha256Stream stream_;
};

}  // namespace

absl::StatusOr<std::string> CheckAndDigestScene(const Scene& scene, ThreadPool& pool,
                                                const std::function<void(int n)>& checked) {
  const auto count = static_cast<int64_t>(scene.views.size());
  std::vector<absl::StatusOr<std::string>> digests(scene.views.size(), std::string());
  std::mutex mutex;
  int done = 0;
  pool.ParallelFor(count, 1, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      digests[i] = CheckPhotograph(scene.views[i]);
      const std::lock_guard<std::mutex> lock(mutex);
      checked(++done);
    }
  });

  ValueDigest digest;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    if (!digests[i].ok()) return BadInput(digests[i].status());
    const SceneView& view = scene.views[i];
    digest.Add(view.name);
    digest.Add(*digests[i]);
    digest.Add(static_cast<int64_t>(view.lens.model));
    for (const int size : {view.lens.width, view.lens.height}) digest.Add(static_cast<int64_t>(size));
    for (const double value : {view.lens.fx, view.lens.fy, view.lens.cx, view.lens.cy, view.lens.skew}) {
      digest.Add(value);
    }
    // Those that models have had from the start; the others where there are any.
    constexpr size_t kAlways = 8;
    for (size_t k = 0; k < view.lens.coefficients.size(); ++k) {
      if (k < kAlways || view.lens.coefficients[k] != 0) digest.Add(view.lens.coefficients[k]);
    }
    for (const double value : view.cam_from_world.rotation.reshaped()) digest.Add(value);
    for (const double value : view.cam_from_world.translation) digest.Add(value);
  }
  // Left out where it is 0, so that work begun by versions that knew none goes on.
  if (!scene.offset.isZero(0)) {
    for (const double value : scene.offset) digest.Add(value);
  }
  if (scene.region.has_value()) {
    for (const double value : scene.region->center) digest.Add(value);
    for (const double value : scene.region->axes.reshaped()) digest.Add(value);
    for (const double value : scene.region->size) digest.Add(value);
  }
  for (const SparsePoint& point : scene.points) {
    for (const double value : point.x_in_world) digest.Add(value);
    digest.Add(static_cast<int64_t>(point.seen_by.size()));
    for (const CameraIndex camera : point.seen_by) digest.Add(static_cast<int64_t>(camera));
  }
  return digest.HexDigest();
}

}  // namespace meshwright
