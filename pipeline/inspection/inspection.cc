// SPDX-License-Identifier: Apache-2.0
#include "pipeline/inspection/inspection.h"

#include <algorithm>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "common/base/bad_input.h"
#include "common/base/status_macros.h"
#include "common/scene/view.h"
#include "worker/job_input/view_cache.h"

namespace meshwright {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kMebibyte = 1 << 20;
constexpr int64_t kBytesPerPatchOnDisk = 24;  // docs/formats/surface.md

class RangeOf {
 public:
  void Add(int64_t value) {
    range_.smallest = count_ == 0 ? value : std::min(range_.smallest, value);
    range_.largest = std::max(range_.largest, value);
    sum_ += value;
    range_.mean = sum_ / ++count_;
  }
  const SizeRange& range() const { return range_; }

 private:
  SizeRange range_;
  int64_t sum_ = 0;
  int64_t count_ = 0;
};

Json RangeToJson(const SizeRange& range) {
  return {{"smallest", range.smallest}, {"mean", range.mean}, {"largest", range.largest}};
}

std::string RangeToText(const SizeRange& range) {
  if (range.smallest == range.largest) return absl::StrCat(range.largest);
  return absl::StrCat(range.smallest, "..", range.largest, " (mean ", range.mean, ")");
}

int64_t ViewBytes(const Camera& camera) { return SamplingImageBytes(camera.width, camera.height); }

}  // namespace

absl::StatusOr<Inspection> Inspect(const Scene& scene, const ReconstructionOptions& options, ThreadPool& pool) {
  MW_RETURN_IF_ERROR(options.Validate());
  std::vector<Camera> cameras;
  for (const SceneView& view : scene.views) cameras.push_back(UndistortedCamera(view, options.max_image_size));
  const absl::StatusOr<FeasiblePairs> pairs = FindFeasiblePairs(cameras, scene.points, options.conductor.pairs, pool);
  if (!pairs.ok()) return BadInput(pairs.status());
  const std::vector<CameraGeometry> geometries = CameraGeometries(cameras);
  const OverlapGraph overlaps = FindOverlaps(geometries, pairs->probes, pairs->matrix, options.conductor.overlap, pool);

  Inspection inspection;
  RangeOf width, height, neighbours, targets, overlapping, columns, rows;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Camera& camera = cameras[i];
    const auto index = static_cast<CameraIndex>(i);
    const Lattice lattice = Lattice::For(camera, options.job.lattice_step);
    const std::vector<CameraIndex> chosen =
        ChooseTargets(index, pairs->matrix.Neighbours(index), geometries, pairs->probes, options.conductor.targets);
    width.Add(camera.width);
    height.Add(camera.height);
    neighbours.Add(pairs->matrix.RowSum(index));
    targets.Add(static_cast<int64_t>(chosen.size()));
    overlapping.Add(static_cast<int64_t>(overlaps.Of(index).size()));
    columns.Add(lattice.columns);
    rows.Add(lattice.rows);
    inspection.pixels += int64_t{camera.width} * camera.height;
    inspection.lattice_nodes += lattice.nodes();
    int64_t bytes =
        ViewBytes(camera) + int64_t{3} * camera.width * camera.height + EstimateCameraJobBytes(camera, options.job);
    for (const CameraIndex target : chosen) bytes += ViewBytes(cameras[static_cast<size_t>(target)]);
    inspection.job_bytes = std::max(inspection.job_bytes, bytes);
  }
  inspection.format = scene.format;
  inspection.warnings = scene.warnings;
  inspection.offset = scene.offset;
  inspection.photographs = static_cast<int>(scene.views.size());
  inspection.masks = static_cast<int>(std::count_if(scene.views.begin(), scene.views.end(),
                                                    [](const SceneView& view) { return !view.mask_path.empty(); }));
  inspection.width = width.range();
  inspection.height = height.range();
  inspection.sparse_points = static_cast<int64_t>(scene.points.size());
  inspection.pairs_from_points = pairs->source == FeasibilitySource::kSparsePoints;
  inspection.pairs = pairs->counts.feasible;
  inspection.cameras_without_pair = pairs->counts.cameras_without_pair;
  inspection.neighbours = neighbours.range();
  inspection.targets = targets.range();
  inspection.overlapping = overlapping.range();
  inspection.lattice_step = options.job.lattice_step;
  inspection.lattice_columns = columns.range();
  inspection.lattice_rows = rows.range();
  // Every ray in a filtered and in an accepted surface.
  inspection.disk_bytes = 2 * kBytesPerPatchOnDisk * inspection.lattice_nodes;
  return inspection;
}

Json ToJson(const Inspection& inspection) {
  return {
      {"format", inspection.format},
      {"warnings", inspection.warnings},
      {"offset", {inspection.offset.x(), inspection.offset.y(), inspection.offset.z()}},
      {"photographs", inspection.photographs},
      {"masks", inspection.masks},
      {"width", RangeToJson(inspection.width)},
      {"height", RangeToJson(inspection.height)},
      {"pixels", inspection.pixels},
      {"sparse_points", inspection.sparse_points},
      {"pairs",
       {{"from", inspection.pairs_from_points ? "sparse points" : "optical axes"},
        {"feasible", inspection.pairs},
        {"cameras_without_pair", inspection.cameras_without_pair},
        {"neighbours", RangeToJson(inspection.neighbours)},
        {"targets", RangeToJson(inspection.targets)},
        {"overlapping", RangeToJson(inspection.overlapping)}}},
      {"lattice",
       {{"step", inspection.lattice_step},
        {"columns", RangeToJson(inspection.lattice_columns)},
        {"rows", RangeToJson(inspection.lattice_rows)},
        {"nodes", inspection.lattice_nodes}}},
      {"expected", {{"job_memory_bytes", inspection.job_bytes}, {"work_folder_bytes_at_most", inspection.disk_bytes}}}};
}

std::string ToText(const Inspection& inspection) {
  std::string text;
  absl::StrAppendFormat(&text, "scene      %s, %d photographs, %d sparse points\n", inspection.format,
                        inspection.photographs, inspection.sparse_points);
  if (inspection.masks > 0) absl::StrAppendFormat(&text, "masks      of %d photographs\n", inspection.masks);
  if (!inspection.offset.isZero(0)) {
    absl::StrAppendFormat(&text, "           far from zero: computed relative to %.10g %.10g %.10g\n",
                          inspection.offset.x(), inspection.offset.y(), inspection.offset.z());
  }
  absl::StrAppendFormat(&text, "size       width %s, height %s px; %.1f million pixels\n",
                        RangeToText(inspection.width), RangeToText(inspection.height),
                        1e-6 * static_cast<double>(inspection.pixels));
  absl::StrAppendFormat(&text, "pairs      %d feasible, from %s\n", inspection.pairs,
                        inspection.pairs_from_points ? "sparse points" : "optical axes");
  if (inspection.cameras_without_pair > 0) {
    absl::StrAppendFormat(&text, "           %d cameras have none and contribute nothing\n",
                          inspection.cameras_without_pair);
  }
  absl::StrAppendFormat(&text, "cameras    neighbours %s, of them compared with %s, overlapping %s\n",
                        RangeToText(inspection.neighbours), RangeToText(inspection.targets),
                        RangeToText(inspection.overlapping));
  absl::StrAppendFormat(&text, "lattice    step %d px; columns %s, rows %s; %.1f million rays\n",
                        inspection.lattice_step, RangeToText(inspection.lattice_columns),
                        RangeToText(inspection.lattice_rows), 1e-6 * static_cast<double>(inspection.lattice_nodes));
  absl::StrAppendFormat(&text, "memory     about %.0f MiB for each camera job that runs\n",
                        static_cast<double>(inspection.job_bytes) / kMebibyte);
  absl::StrAppendFormat(&text, "disk       at most %.0f MiB while it runs\n",
                        static_cast<double>(inspection.disk_bytes) / kMebibyte);
  return text;
}

}  // namespace meshwright
