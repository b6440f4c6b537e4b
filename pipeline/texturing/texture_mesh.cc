// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/texture_mesh.h"

#include <algorithm>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "pipeline/texturing/atlas_packing.h"
#include "pipeline/texturing/atlas_page.h"
#include "pipeline/texturing/chart_painter.h"
#include "pipeline/texturing/charts.h"
#include "pipeline/texturing/depth_raster.h"
#include "pipeline/texturing/face_graph.h"
#include "pipeline/texturing/face_views.h"
#include "pipeline/texturing/label_solver.h"
#include "pipeline/texturing/prepared_mesh.h"
#include "pipeline/texturing/seam_leveling.h"
#include "pipeline/texturing/seams.h"

#include "common/base/status_macros.h"
#include "common/mesh/formats/textured_mesh_writer.h"
#include "common/scene/view.h"

namespace meshwright {
namespace {

constexpr int kPasses = 3;             // over the photographs
constexpr double kMaxEdgePixels = 48;  // of a triangle, in footprints

class Texturing {
 public:
  Texturing(const Scene& scene, const TextureOptions& options, ThreadPool& pool, const TextureProgress& progress)
      : scene_(scene), options_(options), pool_(pool), progress_(progress) {
    // A chart is at most a photograph and has to fit into a page.
    const int most = options.max_page_size - 2 * kChartPadding - 2;
    for (const SceneView& view : scene.views) {
      Camera camera = UndistortedCamera(view, options.max_image_size);
      max_sizes_.push_back(std::max(camera.width, camera.height) > most ? most : options.max_image_size);
      if (max_sizes_.back() == most) camera = UndistortedCamera(view, most);
      cameras_.push_back(camera);
    }
  }

  absl::Status Prepare(TriangleMesh mesh) {
    report_.footprint = MedianFootprint(mesh, cameras_);
    if (!(report_.footprint > 0)) {
      return absl::FailedPreconditionError("no photograph of the scene shows any of the mesh; is it this scene's?");
    }
    mesh_ = PrepareMesh(std::move(mesh), options_.max_error * report_.footprint, kMaxEdgePixels * report_.footprint);
    if (mesh_.faces.empty()) return absl::FailedPreconditionError("the mesh has 0 faces, expected at least 1");
    edges_ = FindInnerEdges(mesh_);
    report_.vertices = static_cast<int64_t>(mesh_.positions.size());
    report_.faces = static_cast<int64_t>(mesh_.faces.size());
    return absl::OkStatus();
  }

  // Which photograph each face gets.
  absl::Status Label() {
    FaceViews views(mesh_.faces.size());
    for (size_t i = 0; i < cameras_.size(); ++i) {
      const DepthRaster raster(mesh_, cameras_[i], pool_);
      MW_ASSIGN_OR_RETURN(const View view, Load(i));
      views.AddPhotograph(mesh_, raster, static_cast<CameraIndex>(i), view.color, view.ignored, pool_);
      Tell();
    }
    views.RemoveOutliers(pool_);
    labels_ = ChooseLabels(views, edges_, options_.seam_cost);
    report_.faces_unseen = std::ranges::count(labels_, kNoLabel);
    if (report_.faces_unseen == report_.faces) {
      return absl::FailedPreconditionError("no photograph of the scene shows any of the mesh; is it this scene's?");
    }
    charts_ = MakeCharts(mesh_, edges_, labels_, cameras_);
    report_.charts = static_cast<int64_t>(charts_.size());
    return absl::OkStatus();
  }

  // What is to be added to the photographs.
  absl::Status Level() {
    seams_ = std::make_unique<Seams>(mesh_, edges_, charts_, cameras_);
    offsets_ = std::make_unique<VertexOffsets>(mesh_, labels_);
    edges_ = {};
    CollectUnseenCorners();
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (IsUsed(static_cast<int32_t>(i))) {
        MW_ASSIGN_OR_RETURN(const View view, Load(i));
        seams_->Sample(mesh_, static_cast<int32_t>(i), cameras_[i], view.color, pool_);
        SampleUnseenCorners(static_cast<int32_t>(i), view.color);
      }
      Tell();
    }
    if (options_.adjust_colors) LevelSeams(mesh_, labels_, *seams_, *offsets_);
    const SeamJumps jumps = MeasureJumps(*seams_, *offsets_);
    report_.seam_jump_photographs = jumps.as_photographed;
    report_.seam_jump_leveled = jumps.leveled;
    for (auto& [vertex, color] : unseen_corners_) {
      const int32_t label = offsets_->FirstLabel(vertex);
      if (label != kNoLabel) color += offsets_->At(vertex, label);
    }
    return absl::OkStatus();
  }

  absl::Status Write(const MeshFormat& format, const std::string& path) {
    const AtlasLayout layout = PackCharts(charts_, options_.max_page_size);
    report_.pages = static_cast<int64_t>(layout.pages.size());
    for (const PageSize& page : layout.pages) report_.page_pixels += int64_t{page.width} * page.height;
    MW_ASSIGN_OR_RETURN(const auto writer,
                        TexturedMeshWriter::Create(format, path, CutParts(layout), scene_.offset,
                                                   {.png = options_.png, .jpeg_quality = options_.jpeg_quality},
                                                   {.compressed = options_.compressed}));
    MW_RETURN_IF_ERROR(DrawPages(layout, *writer));
    return writer->Commit();
  }

  TriangleMesh& mesh() { return mesh_; }
  const TextureReport& report() const { return report_; }

 private:
  absl::StatusOr<View> Load(size_t i) const { return LoadView(scene_.views[i], max_sizes_[i]); }
  void Tell() { progress_(++photographs_done_, kPasses * static_cast<int>(cameras_.size())); }

  bool IsUsed(int32_t label) const {
    const auto it = std::ranges::lower_bound(charts_, label, {}, [](const Chart& chart) {
      return chart.label == kNoLabel ? std::numeric_limits<int32_t>::max() : chart.label;
    });
    return it != charts_.end() && it->label == label;
  }

  void CollectUnseenCorners() {
    for (size_t f = 0; f < labels_.size(); ++f) {
      if (labels_[f] != kNoLabel) continue;
      for (const uint32_t v : mesh_.faces[f]) {
        const std::array<uint8_t, 3> rgb =
            mesh_.colors.empty() ? std::array<uint8_t, 3>{128, 128, 128} : mesh_.colors[v];
        unseen_corners_[v] = Eigen::Vector3f(rgb[0], rgb[1], rgb[2]);
      }
    }
  }

  // Corners that faces of this photograph have too get its colour.
  void SampleUnseenCorners(int32_t label, const ColorImage& image) {
    const Camera& camera = cameras_[static_cast<size_t>(label)];
    for (auto& [vertex, color] : unseen_corners_) {
      if (offsets_->FirstLabel(vertex) != label) continue;
      const Eigen::Vector3d x_in_cam = camera.CamFromWorld(mesh_.positions[vertex].cast<double>());
      color = SampleColor(image, camera.ProjectFromCam(x_in_cam));
    }
  }

  // The mesh by pages, cut along the borders of charts.
  std::vector<TexturePart> CutParts(const AtlasLayout& layout) const {
    std::vector<TexturePart> parts(layout.pages.size());
    std::vector<int32_t> chart_of_copy(mesh_.positions.size(), -1);
    std::vector<uint32_t> copies(mesh_.positions.size());
    for (const Placement& placement : layout.placements) {
      const Chart& chart = charts_[static_cast<size_t>(placement.chart)];
      TexturePart& part = parts[static_cast<size_t>(placement.page)];
      const PageSize& page = layout.pages[static_cast<size_t>(placement.page)];
      for (const uint32_t f : chart.faces) {
        std::array<uint32_t, 3> face = {};
        for (size_t k = 0; k < 3; ++k) {
          const uint32_t v = mesh_.faces[f][k];
          if (chart_of_copy[v] != placement.chart) {
            chart_of_copy[v] = placement.chart;
            copies[v] = static_cast<uint32_t>(part.positions.size());
            const Eigen::Vector2d in_box = PixelInBox(chart, v, k);
            part.positions.push_back(mesh_.positions[v]);
            part.texture_coordinates.emplace_back(static_cast<float>((in_box.x() + placement.x) / page.width),
                                                  static_cast<float>((in_box.y() + placement.y) / page.height));
          }
          face[k] = copies[v];
        }
        part.faces.push_back(face);
      }
    }
    return parts;
  }

  Eigen::Vector2d PixelInBox(const Chart& chart, uint32_t vertex, size_t corner) const {
    if (chart.label == kNoLabel) return UnseenCorners(chart.box)[corner];
    const Camera& camera = cameras_[static_cast<size_t>(chart.label)];
    return camera.ProjectFromCam(camera.CamFromWorld(mesh_.positions[vertex].cast<double>())) -
           Eigen::Vector2d(chart.box.x0, chart.box.y0);
  }

  absl::Status DrawPages(const AtlasLayout& layout, TexturedMeshWriter& writer) {
    std::deque<AtlasPage> open;  // the last of them is page `opened` - 1
    size_t opened = 0;
    for (size_t begin = 0; begin < layout.placements.size();) {
      // Charts of one photograph at a time.
      const Placement& first = layout.placements[begin];
      const int32_t label = charts_[static_cast<size_t>(first.chart)].label;
      size_t end = begin;
      while (end < layout.placements.size() &&
             charts_[static_cast<size_t>(layout.placements[end].chart)].label == label) {
        ++end;
      }
      View view;
      if (label != kNoLabel) {
        MW_ASSIGN_OR_RETURN(view, Load(static_cast<size_t>(label)));
      }
      for (size_t i = begin; i < end; i += kChartsAtOnce) {
        const size_t last = std::min(end, i + kChartsAtOnce);
        const std::vector<PaintedChart> painted = Paint(layout, i, last, view.color);
        for (size_t j = i; j < last; ++j) {
          const Placement& placement = layout.placements[j];
          while (opened <= static_cast<size_t>(placement.page)) {
            if (open.size() == kOpenPages) {
              MW_RETURN_IF_ERROR(writer.AppendPage(open.front().Finish()));
              open.pop_front();
            }
            open.emplace_back(layout.pages[opened++]);
          }
          const size_t place = open.size() - (opened - static_cast<size_t>(placement.page));
          open[place].Draw(painted[j - i], placement.x, placement.y);
        }
      }
      begin = end;
      if (label != kNoLabel) Tell();
    }
    for (; !open.empty(); open.pop_front()) MW_RETURN_IF_ERROR(writer.AppendPage(open.front().Finish()));
    return absl::OkStatus();
  }

  std::vector<PaintedChart> Paint(const AtlasLayout& layout, size_t begin, size_t end, const ColorImage& photograph) {
    std::vector<PaintedChart> painted(end - begin);
    pool_.ParallelFor(static_cast<int64_t>(painted.size()), 1, [&](int64_t from, int64_t to) {
      for (auto i = static_cast<size_t>(from); i < static_cast<size_t>(to); ++i) {
        const int32_t number = layout.placements[begin + i].chart;
        const Chart& chart = charts_[static_cast<size_t>(number)];
        painted[i] = chart.label == kNoLabel
                         ? PaintUnseenFace(chart.box, UnseenColors(chart))
                         : PaintChart(mesh_, chart, number, cameras_[static_cast<size_t>(chart.label)], photograph,
                                      *seams_, *offsets_, options_.adjust_colors);
      }
    });
    return painted;
  }

  std::array<Eigen::Vector3f, 3> UnseenColors(const Chart& chart) const {
    std::array<Eigen::Vector3f, 3> colors;
    for (size_t k = 0; k < 3; ++k) colors[k] = unseen_corners_.at(mesh_.faces[chart.faces.front()][k]);
    return colors;
  }

  static constexpr size_t kChartsAtOnce = 16;

  const Scene& scene_;
  const TextureOptions& options_;
  ThreadPool& pool_;
  const TextureProgress& progress_;
  std::vector<int> max_sizes_;
  std::vector<Camera> cameras_;
  TriangleMesh mesh_;
  std::vector<InnerEdge> edges_;
  std::vector<int32_t> labels_;
  std::vector<Chart> charts_;
  std::unique_ptr<Seams> seams_;
  std::unique_ptr<VertexOffsets> offsets_;
  std::map<uint32_t, Eigen::Vector3f> unseen_corners_;  // vertex -> colour
  TextureReport report_;
  int photographs_done_ = 0;
};

}  // namespace

nlohmann::ordered_json ToJson(const TextureReport& report) {
  return {{"footprint", report.footprint},
          {"vertices", report.vertices},
          {"faces", report.faces},
          {"faces_unseen", report.faces_unseen},
          {"charts", report.charts},
          {"pages", report.pages},
          {"page_pixels", report.page_pixels},
          {"seam_jump_photographs", report.seam_jump_photographs},
          {"seam_jump_leveled", report.seam_jump_leveled}};
}

absl::StatusOr<TextureReport> WriteTexturedMesh(TriangleMesh mesh, const Scene& scene, const TextureOptions& options,
                                                const MeshFormat& format, const std::string& path, ThreadPool& pool,
                                                const TextureProgress& progress, TriangleMesh* prepared) {
  MW_RETURN_IF_ERROR(options.Validate());
  ChangeOffset(scene.offset, mesh);
  Texturing texturing(scene, options, pool, progress);
  MW_RETURN_IF_ERROR(texturing.Prepare(std::move(mesh)));
  MW_RETURN_IF_ERROR(texturing.Label());
  MW_RETURN_IF_ERROR(texturing.Level());
  MW_RETURN_IF_ERROR(texturing.Write(format, path));
  if (prepared != nullptr) {
    *prepared = std::move(texturing.mesh());
    prepared->offset = scene.offset;
  }
  return texturing.report();
}

}  // namespace meshwright
