#include "common/scene/formats/assemble.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/status_macros.h"
#include "common/image/decode.h"
#include "common/scene/undistorted_pinhole.h"

namespace meshwright {
namespace {

std::string SizeText(int width, int height) { return absl::StrCat(width, " x ", height); }

// A scene's file may come from a stranger: its image names must stay within the scene's folder.
absl::Status CheckImageName(const std::string& name, const Place& place) {
  const std::filesystem::path path(name);
  const bool climbs = std::any_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
  if (name.empty() || name.find('\0') != std::string::npos || path.is_absolute() || climbs) {
    return FieldError(place, "image name", Quoted(name), "a path within the folder of the images");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> FindImageFolder(const ImportedView& first, const std::vector<std::string>& candidates) {
  for (const std::string& folder : candidates) {
    if (IsFile(JoinPath(folder, first.view.name))) return folder;
  }
  return absl::NotFoundError(absl::StrCat(first.named_at.ToString(), ": image ", Quoted(first.view.name),
                                          " not found; looked in ", absl::StrJoin(candidates, ", ")));
}

// Gives the view its picture; reads no more of it than the header.
absl::Status AttachImage(const std::string& folder, ImportedView* imported) {
  SceneView& view = imported->view;
  view.image_path = JoinPath(folder, view.name);
  const absl::StatusOr<ImageSize> size = ReadImageSize(view.image_path);
  if (absl::IsNotFound(size.status())) {
    return absl::NotFoundError(
        absl::StrCat(view.image_path, ": no such image; it is named at ", imported->named_at.ToString()));
  }
  MW_RETURN_IF_ERROR(size.status());
  if (view.lens.width == 0) {
    view.lens.width = size->width;
    view.lens.height = size->height;
    return CheckLens(view.lens, imported->named_at);
  }
  if (size->width != view.lens.width || size->height != view.lens.height) {
    return absl::InvalidArgumentError(
        absl::StrCat(view.image_path, ": the picture has ", SizeText(size->width, size->height), " px; its camera (",
                     imported->named_at.ToString(), ") expects ", SizeText(view.lens.width, view.lens.height)));
  }
  return absl::OkStatus();
}

// `new_index[i]`: where the i-th view went.
void OrderPoints(const std::vector<CameraIndex>& new_index, std::vector<SparsePoint>* points) {
  for (SparsePoint& point : *points) {
    for (CameraIndex& camera : point.seen_by) camera = new_index[static_cast<size_t>(camera)];
    std::sort(point.seen_by.begin(), point.seen_by.end());
    point.seen_by.erase(std::unique(point.seen_by.begin(), point.seen_by.end()), point.seen_by.end());
  }
  std::sort(points->begin(), points->end(), [](const SparsePoint& a, const SparsePoint& b) {
    const auto key = [](const SparsePoint& p) {
      return std::tie(p.seen_by, p.x_in_world.x(), p.x_in_world.y(), p.x_in_world.z(), p.rgb);
    };
    return key(a) < key(b);
  });
}

}  // namespace

absl::Status CheckLens(const Lens& lens, const Place& place) {
  if (lens.width < 1 || lens.height < 1 || int64_t{lens.width} * lens.height > kMaxImagePixels) {
    return FieldError(place, "image size", SizeText(lens.width, lens.height),
                      absl::StrCat("positive sizes and at most ", kMaxImagePixels, " pixels"));
  }
  const double size = std::max(lens.width, lens.height);
  constexpr double kLargestRatio = 1000;  // of focal length and principal point to image size
  if (!(lens.fx > size / kLargestRatio && lens.fy > size / kLargestRatio && lens.fx < size * kLargestRatio &&
        lens.fy < size * kLargestRatio)) {
    return FieldError(place, "focal length", absl::StrCat(lens.fx, ", ", lens.fy, " px"),
                      absl::StrCat("a positive one that fits an image of ", SizeText(lens.width, lens.height), " px"));
  }
  if (!(std::abs(lens.cx) < size * kLargestRatio && std::abs(lens.cy) < size * kLargestRatio)) {
    return FieldError(place, "principal point", absl::StrCat(lens.cx, ", ", lens.cy, " px"),
                      absl::StrCat("one that fits an image of ", SizeText(lens.width, lens.height), " px"));
  }
  if (!(std::abs(lens.skew) < lens.fx)) {
    return FieldError(place, "skew", absl::StrCat(lens.skew, " px"), "less than the focal length");
  }
  for (const double coefficient : lens.coefficients) {
    if (!std::isfinite(coefficient)) {
      return FieldError(place, "distortion coefficient", absl::StrCat(coefficient), "a finite number");
    }
  }
  const Camera pinhole = LargestPinhole(lens);
  constexpr int kSmallestShare = 20;
  if (pinhole.width * kSmallestShare < lens.width || pinhole.height * kSmallestShare < lens.height) {
    return FieldError(
        place, "what the distortion leaves of the image",
        absl::StrCat(SizeText(pinhole.width, pinhole.height), " of ", SizeText(lens.width, lens.height), " px"),
        "more; are principal point and coefficients right?");
  }
  return absl::OkStatus();
}

absl::StatusOr<Eigen::Matrix3d> NearestRotation(const Eigen::Matrix3d& matrix, const Place& place) {
  constexpr double kTolerance = 1e-3;
  const double deviation = (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(deviation <= kTolerance)) {  // also when not a number
    return FieldError(place, "largest entry of R R^T - I", absl::StrCat(deviation),
                      absl::StrCat("a rotation matrix (at most ", kTolerance, ")"));
  }
  if (matrix.determinant() < 0) return FieldError(place, "det R", "-1", "a rotation matrix, not a mirror");
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return Eigen::Matrix3d(svd.matrixU() * svd.matrixV().transpose());
}

absl::StatusOr<Eigen::Matrix3d> RotationFromQuaternion(double w, double x, double y, double z, const Place& place) {
  const Eigen::Quaterniond quaternion(w, x, y, z);
  constexpr double kTolerance = 0.01;
  if (!(std::abs(quaternion.norm() - 1) <= kTolerance)) {
    return FieldError(place, "length of the quaternion", absl::StrCat(quaternion.norm()), "1");
  }
  return quaternion.normalized().toRotationMatrix();
}

absl::StatusOr<Scene> AssembleScene(const std::string& format, const std::string& file, std::vector<ImportedView> views,
                                    std::vector<SparsePoint> points, const std::vector<std::string>& image_folders) {
  if (views.empty()) return absl::InvalidArgumentError(absl::StrCat(file, ": no cameras; expected at least one"));
  for (const ImportedView& imported : views) MW_RETURN_IF_ERROR(CheckImageName(imported.view.name, imported.named_at));

  std::vector<size_t> order(views.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return views[a].view.name < views[b].view.name; });
  for (size_t i = 1; i < order.size(); ++i) {
    const ImportedView& a = views[std::min(order[i - 1], order[i])];
    const ImportedView& b = views[std::max(order[i - 1], order[i])];
    if (a.view.name == b.view.name) {
      return FieldError(b.named_at, "image name", Quoted(b.view.name),
                        absl::StrCat("a name not used before (", a.named_at.ToString(), ")"));
    }
  }

  Scene scene{.format = format, .views = {}, .points = std::move(points)};
  MW_ASSIGN_OR_RETURN(const std::string folder, FindImageFolder(views[order.front()], image_folders));
  std::vector<CameraIndex> new_index(views.size());
  for (const size_t old_index : order) {
    ImportedView& imported = views[old_index];
    MW_RETURN_IF_ERROR(AttachImage(folder, &imported));
    new_index[old_index] = static_cast<CameraIndex>(scene.views.size());
    scene.views.push_back(std::move(imported.view));
  }
  OrderPoints(new_index, &scene.points);
  return scene;
}

bool IsFile(const std::string& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error);
}

bool IsFolder(const std::string& path) {
  std::error_code error;
  return std::filesystem::is_directory(path, error);
}

std::string JoinPath(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder) / name).lexically_normal().string();
}

std::vector<std::string> FilesEndingIn(const std::string& folder, const std::string& suffix) {
  std::vector<std::string> names;
  std::error_code error;
  std::filesystem::directory_iterator it(folder, error);
  for (; !error && it != std::filesystem::directory_iterator(); it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.size() > suffix.size() && name.compare(name.size() - suffix.size(), suffix.size(), suffix) == 0 &&
        IsFile(it->path().string())) {
      names.push_back(name);
    }
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace meshwright
