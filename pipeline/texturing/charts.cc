// SPDX-License-Identifier: Apache-2.0
#include "pipeline/texturing/charts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "pipeline/texturing/label_solver.h"

#include "common/mesh/disjoint_sets.h"

namespace meshwright {
namespace {

constexpr int kMaxIterations = 40;
constexpr size_t kSmallChart = 10;  // faces
constexpr int kMergeRounds = 3;
constexpr int kUnseenSide = 6;  // px, of the chart of a face without photograph

// Number of the connected component of faces with one label, in the order of their first faces.
std::vector<int32_t> FindComponents(const std::vector<InnerEdge>& edges, const std::vector<int32_t>& labels,
                                    int32_t* count) {
  DisjointSets sets(labels.size());
  for (const InnerEdge& edge : edges) {
    const auto [a, b] = edge.faces;
    const int32_t label = labels[static_cast<size_t>(a)];
    if (label != kNoLabel && label == labels[static_cast<size_t>(b)]) sets.Join(a, b);
  }
  std::vector<int32_t> number_of_root(labels.size(), -1);
  std::vector<int32_t> components(labels.size());
  *count = 0;
  for (size_t f = 0; f < labels.size(); ++f) {
    int32_t& number = number_of_root[static_cast<size_t>(sets.Root(static_cast<int32_t>(f)))];
    if (number < 0) number = (*count)++;
    components[f] = number;
  }
  return components;
}

bool Shows(const FaceViews& views, uint32_t face, int32_t label) {
  return std::ranges::any_of(views.Of(face), [&](const FaceView& view) { return view.camera == label; });
}

// Small components take the label of the neighbour that they share most edges with, if it shows all of their faces.
// Returns whether any did.
bool MergeSmallComponents(const FaceViews& views, const std::vector<InnerEdge>& edges, std::vector<int32_t>& labels) {
  int32_t count = 0;
  const std::vector<int32_t> components = FindComponents(edges, labels, &count);
  std::vector<std::vector<uint32_t>> faces(static_cast<size_t>(count));
  for (size_t f = 0; f < labels.size(); ++f) {
    auto& list = faces[static_cast<size_t>(components[f])];
    if (labels[f] != kNoLabel && list.size() < kSmallChart) list.push_back(static_cast<uint32_t>(f));
  }
  std::map<std::pair<int32_t, int32_t>, int> shared;  // (small component, label beside it) -> edges
  const auto is_small = [&](int32_t component) {
    const size_t size = faces[static_cast<size_t>(component)].size();
    return size > 0 && size < kSmallChart;
  };
  for (const InnerEdge& edge : edges) {
    for (size_t side = 0; side < 2; ++side) {
      const auto here = static_cast<size_t>(edge.faces[side]);
      const auto there = static_cast<size_t>(edge.faces[1 - side]);
      if (labels[there] == kNoLabel || labels[here] == labels[there] || !is_small(components[here])) continue;
      ++shared[{components[here], labels[there]}];
    }
  }
  const std::vector<int32_t> before = labels;
  std::vector<int> most(static_cast<size_t>(count), 0);
  for (const auto& [key, edges_shared] : shared) {
    const auto component = static_cast<size_t>(key.first);
    if (edges_shared <= most[component]) continue;
    const std::vector<uint32_t>& members = faces[component];
    if (!std::ranges::all_of(members, [&](uint32_t f) { return Shows(views, f, key.second); })) continue;
    most[component] = edges_shared;
    for (const uint32_t f : members) labels[f] = key.second;
  }
  return labels != before;
}

PixelBox BoxOf(const TriangleMesh& mesh, const std::vector<uint32_t>& faces, const Camera& camera) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (const uint32_t f : faces) {
    for (const uint32_t v : mesh.faces[f]) {
      const Eigen::Vector2d pixel = camera.ProjectFromCam(camera.CamFromWorld(mesh.positions[v].cast<double>()));
      low = low.cwiseMin(pixel);
      high = high.cwiseMax(pixel);
    }
  }
  return {std::max(0, static_cast<int>(std::floor(low.x())) - 1),
          std::max(0, static_cast<int>(std::floor(low.y())) - 1),
          std::min(camera.width, static_cast<int>(std::floor(high.x())) + 2),
          std::min(camera.height, static_cast<int>(std::floor(high.y())) + 2)};
}

}  // namespace

std::vector<int32_t> ChooseLabels(const FaceViews& views, const std::vector<InnerEdge>& edges, double seam_cost) {
  LabelProblem problem;
  problem.different_cost = static_cast<float>(seam_cost);
  problem.first.push_back(0);
  for (size_t f = 0; f < views.faces(); ++f) {
    std::vector<FaceView> candidates(views.Of(f).begin(), views.Of(f).end());
    std::ranges::sort(candidates, {}, &FaceView::camera);
    float best = 0;
    for (const FaceView& view : candidates) best = std::max(best, view.quality);
    for (const FaceView& view : candidates) {
      problem.labels.push_back(view.camera);
      problem.costs.push_back(1 - view.quality / best);
    }
    problem.first.push_back(static_cast<int32_t>(problem.labels.size()));
  }
  for (const InnerEdge& edge : edges) problem.edges.push_back(edge.faces);
  std::vector<int32_t> labels = SolveLabels(problem, kMaxIterations).labels;
  for (int round = 0; round < kMergeRounds && MergeSmallComponents(views, edges, labels); ++round) {
  }
  return labels;
}

std::vector<Chart> MakeCharts(const TriangleMesh& mesh, const std::vector<InnerEdge>& edges,
                              const std::vector<int32_t>& labels, const std::vector<Camera>& cameras) {
  int32_t count = 0;
  const std::vector<int32_t> components = FindComponents(edges, labels, &count);
  std::vector<Chart> charts(static_cast<size_t>(count));
  for (size_t f = 0; f < labels.size(); ++f) {
    Chart& chart = charts[static_cast<size_t>(components[f])];
    chart.label = labels[f];
    chart.faces.push_back(static_cast<uint32_t>(f));
  }
  for (Chart& chart : charts) {
    chart.box = chart.label == kNoLabel ? PixelBox{0, 0, kUnseenSide, kUnseenSide}
                                        : BoxOf(mesh, chart.faces, cameras[static_cast<size_t>(chart.label)]);
  }
  std::ranges::stable_sort(charts, {}, [](const Chart& chart) {
    return chart.label == kNoLabel ? std::numeric_limits<int32_t>::max() : chart.label;
  });
  return charts;
}

}  // namespace meshwright
