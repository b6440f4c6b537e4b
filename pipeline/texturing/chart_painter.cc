// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/chart_painter.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "pipeline/texturing/triangle_raster.h"

namespace meshwright {
namespace {

constexpr int kSweeps = 60;
constexpr float kOverRelaxation = 1.8F;

uint8_t ToByte(float value) { return static_cast<uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F)); }

class ChartCanvas {
 public:
  ChartCanvas(const PixelBox& box)
      : box_(box),
        width_(static_cast<size_t>(box.width())),
        height_(static_cast<size_t>(box.height())),
        offsets_(width_ * height_, Eigen::Vector3f::Zero()),
        covered_(width_ * height_, 0) {}

  void DrawFaces(const TriangleMesh& mesh, const Chart& chart, const Camera& camera, const VertexOffsets& offsets) {
    for (const uint32_t f : chart.faces) {
      std::array<Eigen::Vector2d, 3> corners;
      Eigen::Matrix3f corner_offsets;
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t v = mesh.faces[f][k];
        corners[k] = camera.ProjectFromCam(camera.CamFromWorld(mesh.positions[v].cast<double>()));
        corner_offsets.col(static_cast<Eigen::Index>(k)) = offsets.At(v, chart.label);
      }
      const ImageTriangle triangle(corners[0], corners[1], corners[2]);
      triangle.ForEachPixel(box_, [&](int x, int y, const Eigen::Vector3d& weights) {
        Cover(Index(x, y), corner_offsets * weights.cast<float>());
      });
      const Eigen::Vector2d middle = (corners[0] + corners[1] + corners[2]) / 3;  // of one smaller than a pixel
      const auto x = static_cast<int>(middle.x());
      const auto y = static_cast<int>(middle.y());
      if (Holds(x, y) && covered_[Index(x, y)] == 0) Cover(Index(x, y), corner_offsets.rowwise().mean());
    }
  }

  // Pixels beside covered ones become covered, with the mean of their neighbours' offsets.
  void Grow() {
    std::vector<size_t> ring;
    std::vector<Eigen::Vector3f> values;
    for (int y = box_.y0; y < box_.y1; ++y) {
      for (int x = box_.x0; x < box_.x1; ++x) {
        if (covered_[Index(x, y)] != 0) continue;
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        float count = 0;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            if (!Holds(x + dx, y + dy) || covered_[Index(x + dx, y + dy)] == 0) continue;
            sum += offsets_[Index(x + dx, y + dy)];
            count += 1;
          }
        }
        if (count == 0) continue;
        ring.push_back(Index(x, y));
        values.emplace_back(sum / count);
      }
    }
    for (size_t i = 0; i < ring.size(); ++i) Cover(ring[i], values[i]);
  }

  // Pixels around `pixel` are to change by `change` on average.
  void Constrain(const Eigen::Vector2d& pixel, const Eigen::Vector3f& change) {
    if (weights_.empty()) {
      weights_.assign(offsets_.size(), 0.0F);
      changes_.assign(offsets_.size(), Eigen::Vector3f::Zero());
    }
    const double x = pixel.x() - 0.5;
    const double y = pixel.y() - 0.5;
    const int x0 = static_cast<int>(std::floor(x));
    const int y0 = static_cast<int>(std::floor(y));
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) {
        if (!Holds(x0 + dx, y0 + dy)) continue;
        const auto weight = static_cast<float>((1 - std::abs(x - x0 - dx)) * (1 - std::abs(y - y0 - dy)));
        const size_t i = Index(x0 + dx, y0 + dy);
        if (covered_[i] == 0 || !(weight > 0)) continue;
        weights_[i] += weight;
        changes_[i] += weight * change;
      }
    }
  }

  // Spreads the changes over the strip beside the constrained pixels: Laplace's equation, no change at the strip's
  // inner end, none across the chart's border.
  void SpreadChanges() {
    if (weights_.empty()) return;
    const std::vector<size_t> strip = FindStrip();
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      for (size_t n = 0; n < strip.size(); ++n) {
        const size_t i = sweep % 2 == 0 ? strip[n] : strip[strip.size() - 1 - n];
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        float count = 0;
        ForEachNeighbor(i, [&](size_t j) {
          sum += changes_[j];
          count += 1;
        });
        if (count > 0) changes_[i] += kOverRelaxation * (sum / count - changes_[i]);
      }
    }
    for (size_t i = 0; i < offsets_.size(); ++i) offsets_[i] += changes_[i];
  }

  PaintedChart Finish(const ColorImage& photograph) {
    PaintedChart painted;
    painted.image = {box_.width(), box_.height(), std::vector<uint8_t>(3 * offsets_.size(), 0)};
    for (int y = box_.y0; y < box_.y1; ++y) {
      for (int x = box_.x0; x < box_.x1; ++x) {
        const size_t i = Index(x, y);
        if (covered_[i] == 0) continue;
        const std::array<uint8_t, 3> rgb = photograph.At(x, y);
        for (size_t k = 0; k < 3; ++k) {
          painted.image.rgb[3 * i + k] = ToByte(rgb[k] + offsets_[i][static_cast<Eigen::Index>(k)]);
        }
      }
    }
    painted.covered = std::move(covered_);
    return painted;
  }

 private:
  bool Holds(int x, int y) const { return x >= box_.x0 && y >= box_.y0 && x < box_.x1 && y < box_.y1; }
  size_t Index(int x, int y) const {
    return static_cast<size_t>(y - box_.y0) * width_ + static_cast<size_t>(x - box_.x0);
  }
  void Cover(size_t i, const Eigen::Vector3f& offset) {
    covered_[i] = 1;
    offsets_[i] = offset;
  }

  template <typename Visit>
  void ForEachNeighbor(size_t i, const Visit& visit) const {
    const size_t x = i % width_;
    const size_t y = i / width_;
    if (x > 0 && covered_[i - 1] != 0) visit(i - 1);
    if (x + 1 < width_ && covered_[i + 1] != 0) visit(i + 1);
    if (y > 0 && covered_[i - width_] != 0) visit(i - width_);
    if (y + 1 < height_ && covered_[i + width_] != 0) visit(i + width_);
  }

  // Covered pixels up to kStripPixels from constrained ones, these left out, in the order of their numbers. Constrained
  // pixels get their change.
  std::vector<size_t> FindStrip() {
    std::vector<uint8_t> seen(offsets_.size(), 0);
    std::vector<size_t> front;
    for (size_t i = 0; i < weights_.size(); ++i) {
      if (!(weights_[i] > 0)) continue;
      changes_[i] /= weights_[i];
      seen[i] = 1;
      front.push_back(i);
    }
    std::vector<size_t> strip;
    for (int step = 0; step < kStripPixels; ++step) {
      std::vector<size_t> next;
      for (const size_t i : front) {
        ForEachNeighbor(i, [&](size_t j) {
          if (seen[j] != 0) return;
          seen[j] = 1;
          next.push_back(j);
        });
      }
      strip.insert(strip.end(), next.begin(), next.end());
      front = std::move(next);
    }
    std::ranges::sort(strip);
    return strip;
  }

  const PixelBox box_;
  const size_t width_;
  const size_t height_;
  std::vector<Eigen::Vector3f> offsets_;  // what is added to the photograph
  std::vector<uint8_t> covered_;
  std::vector<float> weights_;            // of constraints
  std::vector<Eigen::Vector3f> changes_;  // to the offsets
};

}  // namespace

PaintedChart PaintChart(const TriangleMesh& mesh, const Chart& chart, int32_t chart_number, const Camera& camera,
                        const ColorImage& photograph, const Seams& seams, const VertexOffsets& offsets, bool adjust) {
  ChartCanvas canvas(chart.box);
  canvas.DrawFaces(mesh, chart, camera, offsets);
  canvas.Grow();
  if (adjust) {
    for (const int32_t number : seams.Around(chart_number)) {
      const Seam& seam = seams.all()[static_cast<size_t>(number)];
      const float sign = seam.charts[0] == chart_number ? 1.0F : -1.0F;
      const Eigen::Vector3d a = mesh.positions[seam.vertices[0]].cast<double>();
      const Eigen::Vector3d b = mesh.positions[seam.vertices[1]].cast<double>();
      for (int i = 0; i < seam.samples; ++i) {
        const Eigen::Vector3d x = a + Seams::Place(seam, i) * (b - a);
        canvas.Constrain(camera.ProjectFromCam(camera.CamFromWorld(x)), sign * HalfGap(seams, seam, i, offsets));
      }
    }
    canvas.SpreadChanges();
  }
  return canvas.Finish(photograph);
}

std::array<Eigen::Vector2d, 3> UnseenCorners(const PixelBox& box) {
  return {Eigen::Vector2d(1, 1), Eigen::Vector2d(box.width() - 1, 1), Eigen::Vector2d(1, box.height() - 1)};
}

PaintedChart PaintUnseenFace(const PixelBox& box, const std::array<Eigen::Vector3f, 3>& corner_colors) {
  PaintedChart painted;
  painted.image = {box.width(), box.height(), {}};
  painted.covered.assign(static_cast<size_t>(box.width()) * static_cast<size_t>(box.height()), 1);
  const std::array<Eigen::Vector2d, 3> corners = UnseenCorners(box);
  const ImageTriangle triangle(corners[0], corners[1], corners[2]);
  for (int y = 0; y < box.height(); ++y) {
    for (int x = 0; x < box.width(); ++x) {
      const Eigen::Vector3f weights = triangle.Weights({x + 0.5, y + 0.5}).cast<float>();
      const Eigen::Vector3f color =
          weights[0] * corner_colors[0] + weights[1] * corner_colors[1] + weights[2] * corner_colors[2];
      for (int k = 0; k < 3; ++k) painted.image.rgb.push_back(ToByte(color[k]));
    }
  }
  return painted;
}

}  // namespace meshwright
