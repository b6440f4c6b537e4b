// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/assemble.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "common/base/status_macros.h"
#include "common/base/utf8.h"
#include "common/image/decode.h"
#include "common/scene/formats/masks.h"
#include "common/scene/formats/world_offset.h"
#include "common/scene/undistorted_pinhole.h"

namespace meshwright {
namespace {

constexpr CameraIndex kDropped = -1;

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

// Whether the picture is the camera's, made larger or smaller: the sides have one ratio, but for their rounding.
bool HasOneFactor(const ImageSize& size, const Lens& lens) {
  const double factor = static_cast<double>(size.width) / lens.width;
  return std::abs(factor * lens.height - size.height) <= std::max(1.0, factor);
}

void Rescale(const ImageSize& size, Lens* lens) {
  const double x = static_cast<double>(size.width) / lens->width;
  const double y = static_cast<double>(size.height) / lens->height;
  lens->width = size.width;
  lens->height = size.height;
  lens->fx *= x;
  lens->skew *= x;
  lens->cx *= x;
  lens->fy *= y;
  lens->cy *= y;
}

// Reads no more of the view's picture than the header.
absl::Status CheckImageSize(const ImportOptions& options, ImportedView* imported) {
  SceneView& view = imported->view;
  MW_ASSIGN_OR_RETURN(const ImageSize size, ReadImageSize(view.image_path));
  if (view.lens.width == 0) {
    if (imported->lens_of_size != nullptr) {
      MW_ASSIGN_OR_RETURN(view.lens, imported->lens_of_size(size.width, size.height));
    }
    view.lens.width = size.width;
    view.lens.height = size.height;
    return CheckLens(view.lens, imported->named_at);
  }
  if (size.width != view.lens.width || size.height != view.lens.height) {
    const bool one_factor = HasOneFactor(size, view.lens);
    if (one_factor && options.rescale_cameras) {
      Rescale(size, &view.lens);
      return CheckLens(view.lens, imported->named_at);
    }
    return absl::InvalidArgumentError(
        absl::StrCat(view.image_path, ": the picture has ", SizeText(size.width, size.height), " px; its camera (",
                     imported->named_at.ToString(), ") expects ", SizeText(view.lens.width, view.lens.height),
                     one_factor ? "; --rescale-cameras makes cameras follow" : ""));
  }
  return absl::OkStatus();
}

// `new_index[i]`: where the i-th view went; kDropped when it was dropped.
void OrderPoints(const std::vector<CameraIndex>& new_index, std::vector<SparsePoint>* points) {
  for (SparsePoint& point : *points) {
    for (CameraIndex& camera : point.seen_by) camera = new_index[static_cast<size_t>(camera)];
    std::erase(point.seen_by, kDropped);
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

absl::StatusOr<std::vector<size_t>> OrderOfNames(const std::vector<ImportedView>& views) {
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
  return order;
}

std::string LowerCase(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// Looks for pictures in folders, best first.
class PictureFinder {
 public:
  explicit PictureFinder(const std::vector<std::string>& folders) : folders_(folders) {}

  // Empty when there is none. InvalidArgument: the last part of the name fits several.
  absl::StatusOr<std::string> Find(const ImportedView& view) {
    const std::vector<std::string> spellings = SpellingsOf(view.view.name);
    for (const std::string& folder : folders_) {
      for (const std::string& name : spellings) {
        std::string path = JoinPath(folder, name);
        if (IsFile(path)) return path;
      }
    }
    for (const bool any_case : {false, true}) {
      std::vector<std::string> hits;
      for (const std::string& name : spellings) AppendHits(name, any_case, &hits);
      if (hits.size() == 1) return hits.front();
      if (hits.size() > 1) {
        return FieldError(view.named_at, "image", Quoted(view.view.name),
                          absl::StrCat("one picture, not both ", hits[0], " and ", hits[1]));
      }
    }
    return std::string();
  }

 private:
  static std::vector<std::string> SpellingsOf(const std::string& name) {
    const std::string ending = LowerCase(std::filesystem::path(name).extension().string());
    std::vector<std::string> spellings = {name};
    for (const char* known : {".png", ".jpg", ".jpeg", ".pgm", ".ppm"}) {
      if (ending == known) return spellings;
    }
    for (const char* missing : {".png", ".jpg", ".jpeg", ".JPG"}) spellings.push_back(name + missing);
    return spellings;
  }

  void AppendHits(const std::string& name, bool any_case, std::vector<std::string>* hits) {
    const std::string base = std::filesystem::path(name).filename().string();
    if (!listed_) List();
    const auto [begin, end] = paths_.equal_range(LowerCase(base));
    for (auto it = begin; it != end; ++it) {
      if (any_case || std::filesystem::path(it->second).filename().string() == base) hits->push_back(it->second);
    }
  }

  void List() {
    listed_ = true;
    for (const std::string& folder : folders_) {
      for (const std::string& name : FilesEndingIn(folder, "")) {
        paths_.emplace(LowerCase(name), JoinPath(folder, name));
      }
    }
  }

  const std::vector<std::string>& folders_;
  bool listed_ = false;
  std::multimap<std::string, std::string> paths_;  // by their last part in lower case
};

// Gives every view its picture. Those without are left with an empty image_path, and there is a warning, when enough
// others remain; else an error.
absl::Status FindPictures(const std::vector<size_t>& order, ImportedScene* imported) {
  PictureFinder finder(imported->image_folders);
  std::vector<const ImportedView*> missing;
  for (const size_t i : order) {
    ImportedView& view = imported->views[i];
    MW_ASSIGN_OR_RETURN(view.view.image_path, finder.Find(view));
    if (view.view.image_path.empty()) missing.push_back(&view);
  }
  if (missing.empty()) return absl::OkStatus();
  const ImportedView& first = *missing.front();
  if (missing.size() == order.size()) {
    return absl::NotFoundError(absl::StrCat(first.named_at.ToString(), ": image ", Quoted(first.view.name),
                                            " not found; looked in ", absl::StrJoin(imported->image_folders, ", "),
                                            "; --images FOLDER says where the photographs are"));
  }
  constexpr size_t kFewest = 3;
  const size_t left = order.size() - missing.size();
  if (left < kFewest || 2 * left < order.size()) {
    return absl::NotFoundError(absl::StrCat(JoinPath(imported->image_folders.front(), first.view.name),
                                            ": no such image; it is named at ", first.named_at.ToString(), "; ",
                                            missing.size(), " of ", order.size(), " are missing"));
  }
  std::vector<std::string> names;
  for (size_t i = 0; i < std::min<size_t>(missing.size(), 3); ++i) names.push_back(Quoted(missing[i]->view.name));
  imported->warnings.push_back(absl::StrCat(missing.size(), " of ", order.size(),
                                            " cameras are left out because their photographs are missing: ",
                                            absl::StrJoin(names, ", "), missing.size() > 3 ? " ..." : ""));
  return absl::OkStatus();
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

std::string PortableImageName(const std::string& path) {
  std::string name = path;
  std::replace(name.begin(), name.end(), '\\', '/');
  const bool has_drive = name.size() > 1 && name[1] == ':';
  const std::filesystem::path parts = std::filesystem::path(name).lexically_normal();
  const bool climbs = std::find(parts.begin(), parts.end(), "..") != parts.end();
  return has_drive || parts.is_absolute() || climbs ? parts.filename().string() : parts.string();
}

absl::StatusOr<Scene> AssembleScene(ImportedScene imported, const ImportOptions& options) {
  std::vector<ImportedView>& views = imported.views;
  if (views.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(imported.file, ": no cameras; expected at least one"));
  }
  for (const ImportedView& view : views) MW_RETURN_IF_ERROR(CheckImageName(view.view.name, view.named_at));
  if (!options.images_folder.empty()) {
    if (!IsFolder(options.images_folder)) {
      return absl::NotFoundError(absl::StrCat(options.images_folder, ": no such folder; expected the photographs"));
    }
    imported.image_folders = {options.images_folder};
  }
  MW_ASSIGN_OR_RETURN(std::vector<size_t> order, OrderOfNames(views));
  MW_RETURN_IF_ERROR(FindPictures(order, &imported));
  for (ImportedView& view : views) view.view.name = ToUtf8(view.view.name);  // files are found by their bytes
  MW_ASSIGN_OR_RETURN(order, OrderOfNames(views));

  Scene scene{.format = std::move(imported.format), .views = {}, .points = std::move(imported.points)};
  scene.warnings = std::move(imported.warnings);
  std::vector<CameraIndex> new_index(views.size(), kDropped);
  for (const size_t old_index : order) {
    if (views[old_index].view.image_path.empty()) continue;
    MW_RETURN_IF_ERROR(CheckImageSize(options, &views[old_index]));
    new_index[old_index] = static_cast<CameraIndex>(scene.views.size());
    scene.views.push_back(std::move(views[old_index].view));
  }
  MW_RETURN_IF_ERROR(FindMasks(imported.image_folders, options.masks_folder, &scene));
  MoveNearZero(&scene);
  OrderPoints(new_index, &scene.points);
  return scene;
}

absl::StatusOr<size_t> ChooseLargest(const std::string& file, const std::vector<size_t>& photographs,
                                     const ImportOptions& options, std::vector<std::string>* warnings) {
  auto chosen = static_cast<size_t>(std::max_element(photographs.begin(), photographs.end()) - photographs.begin());
  if (options.model.has_value()) chosen = static_cast<size_t>(*options.model);
  if (chosen >= photographs.size()) {
    return absl::NotFoundError(
        absl::StrCat(file, ": model is ", chosen, "; expected one from 0 to ", photographs.size() - 1));
  }
  for (size_t i = 0; i < photographs.size(); ++i) {
    if (i == chosen) continue;
    warnings->push_back(absl::StrCat("model ", i, " of ", file, " (", photographs[i],
                                     " photographs) is another reconstruction and is not used; --model ", i,
                                     " takes it"));
  }
  return chosen;
}

std::string LowerCaseEnding(const std::string& name) {
  return LowerCase(std::filesystem::path(name).extension().string());
}

std::string ReadHead(const std::string& path, size_t size) {
  std::string head(size, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(size));
  head.resize(static_cast<size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return head;
}

std::string NameOfFolder(const std::string& folder) {
  std::error_code ignored;
  const std::filesystem::path path = std::filesystem::absolute(folder, ignored).lexically_normal();
  return (path.has_filename() ? path : path.parent_path()).filename().string();
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

std::string FirstFileEndingIn(const std::string& folder, const std::string& suffix) {
  const std::vector<std::string> names = FilesEndingIn(folder, suffix);
  return names.empty() ? "" : JoinPath(folder, names.front());
}

}  // namespace meshwright
