// SPDX-License-Identifier: Apache-2.0
#include "tests/scene_formats/scene_writers.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <nlohmann/json.hpp>

#include "common/base/check.h"
#include "common/base/little_endian.h"

namespace meshwright {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using nlohmann::json;

std::string Digits(double value) { return absl::StrFormat("%.17g", value); }

template <typename Values>
std::string Line(const Values& values) {
  std::string line;
  for (const double value : values) absl::StrAppend(&line, line.empty() ? "" : " ", Digits(value));
  return line;
}

std::string Rows(const Matrix3d& m, const char* between = " ") {
  std::string text;
  for (int row = 0; row < 3; ++row) absl::StrAppend(&text, row > 0 ? between : "", Line(m.row(row)));
  return text;
}

json List(const Matrix3d& m) {
  json list = json::array();
  for (int row = 0; row < 3; ++row) list.push_back({m(row, 0), m(row, 1), m(row, 2)});
  return list;
}

json List(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Vector3d CenterOf(const SceneView& view) {
  return -(view.cam_from_world.rotation.transpose() * view.cam_from_world.translation);
}

Matrix3d WorldFromCam(const SceneView& view) { return view.cam_from_world.rotation.transpose(); }

Eigen::Vector2d PixelOf(const Scene& scene, CameraIndex camera, const Vector3d& x) {
  const SceneView& view = scene.views[static_cast<size_t>(camera)];
  return view.lens.PixelFromPlane((view.cam_from_world * x).hnormalized());
}

// k1 k2 k3 p1 p2 of the models that the writers get.
struct Coefficients {
  explicit Coefficients(const Lens& lens) {
    const auto& c = lens.coefficients;
    MW_CHECK(lens.model == Lens::Model::kPinhole || lens.model == Lens::Model::kRadial ||
             lens.model == Lens::Model::kOpenCv || lens.model == Lens::Model::kFullOpenCv);
    k1 = c[0];
    k2 = c[1];
    if (lens.model == Lens::Model::kPinhole || lens.model == Lens::Model::kRadial) return;
    p1 = c[2];
    p2 = c[3];
    k3 = c[4];
  }
  double k1 = 0;
  double k2 = 0;
  double k3 = 0;
  double p1 = 0;
  double p2 = 0;
};

SceneFiles AsOpenSfm(const Scene& scene) {
  json root = {{"cameras", json::object()}, {"shots", json::object()}, {"points", json::object()}};
  std::string tracks = "OPENSFM_TRACKS_VERSION_v2\n";
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const SceneView& view = scene.views[i];
    const Lens& lens = view.lens;
    const Coefficients c(lens);
    const double size = std::max(lens.width, lens.height);
    const std::string id = absl::StrCat("v2 unknown ", i);
    root["cameras"][id] = {{"projection_type", "brown"},
                           {"width", lens.width},
                           {"height", lens.height},
                           {"focal_x", lens.fx / size},
                           {"focal_y", lens.fy / size},
                           {"c_x", (lens.cx - lens.width / 2.0) / size},
                           {"c_y", (lens.cy - lens.height / 2.0) / size},
                           {"k1", c.k1},
                           {"k2", c.k2},
                           {"k3", c.k3},
                           {"p1", c.p1},
                           {"p2", c.p2}};
    const Eigen::AngleAxisd turn(view.cam_from_world.rotation);
    root["shots"][view.name] = {{"camera", id},
                                {"rotation", List(Vector3d(turn.angle() * turn.axis()))},
                                {"translation", List(view.cam_from_world.translation)}};
  }
  for (size_t p = 0; p < scene.points.size(); ++p) {
    const SparsePoint& point = scene.points[p];
    root["points"][absl::StrCat(p)] = {{"coordinates", List(point.x_in_world)},
                                       {"color", {point.rgb[0], point.rgb[1], point.rgb[2]}}};
    for (const CameraIndex camera : point.seen_by) {
      absl::StrAppend(&tracks, scene.views[static_cast<size_t>(camera)].name, "\t", p, "\t7\t0.1\t0.2\t1\t1\t2\t3\n");
    }
  }
  return {{"reconstruction.json", json::array({root}).dump()}, {"tracks.csv", tracks}};
}

SceneFiles AsAliceVision(const Scene& scene, int minor_patch) {
  const auto text = [](double value) { return Digits(value); };
  json root = {{"version", {"1", "2", absl::StrCat(minor_patch)}}};
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const SceneView& view = scene.views[i];
    const Lens& lens = view.lens;
    const Coefficients c(lens);
    const std::string id = absl::StrCat(1000 + i);
    constexpr double kSensorWidth = 36;
    const bool last = minor_patch >= 11;
    const double ratio = last || minor_patch < 5 ? (last ? lens.fy / lens.fx : lens.fx / lens.fy) : lens.fy / lens.fx;
    const double focal = (last ? lens.fy : lens.fx) * kSensorWidth / lens.width;
    root["views"].push_back({{"viewId", id},
                             {"poseId", id},
                             {"intrinsicId", id},
                             {"path", "/home/someone/" + view.name},
                             {"width", absl::StrCat(lens.width)},
                             {"height", absl::StrCat(lens.height)}});
    root["intrinsics"].push_back(
        {{"intrinsicId", id},
         {"width", absl::StrCat(lens.width)},
         {"height", absl::StrCat(lens.height)},
         {"sensorWidth", text(kSensorWidth)},
         {"sensorHeight", text(24)},
         {"type", "pinhole"},
         {"focalLength", text(focal)},
         {"pixelRatio", text(ratio)},
         {"principalPoint", {text(lens.cx - lens.width / 2.0), text(lens.cy - lens.height / 2.0)}},
         {"distortionType", "brown"},
         {"distortionParams", {text(c.k1), text(c.k2), text(c.k3), text(c.p1), text(c.p2)}},
         {"undistortionType", "none"}});
    json rotation = json::array();
    for (const double entry : view.cam_from_world.rotation.reshaped()) rotation.push_back(text(entry));
    const Vector3d center = CenterOf(view);
    root["poses"].push_back(
        {{"poseId", id},
         {"pose",
          {{"transform", {{"rotation", rotation}, {"center", {text(center.x()), text(center.y()), text(center.z())}}}},
           {"locked", "0"}}}});
  }
  for (size_t p = 0; p < scene.points.size(); ++p) {
    const SparsePoint& point = scene.points[p];
    json observations = json::array();
    for (const CameraIndex camera : point.seen_by) {
      const Eigen::Vector2d pixel = PixelOf(scene, camera, point.x_in_world);
      observations.push_back({{"observationId", absl::StrCat(1000 + camera)},
                              {"featureId", "1"},
                              {"x", {text(pixel.x()), text(pixel.y())}}});
    }
    const Vector3d& x = point.x_in_world;
    root["structure"].push_back(
        {{"landmarkId", absl::StrCat(p)},
         {"descType", "sift"},
         {"color", {absl::StrCat(point.rgb[0]), absl::StrCat(point.rgb[1]), absl::StrCat(point.rgb[2])}},
         {"X", {text(x.x()), text(x.y()), text(x.z())}},
         {"observations", observations}});
  }
  return {{"cameras.sfm", root.dump()}};
}

SceneFiles AsOpenMvg(const Scene& scene) {
  constexpr int64_t kFirst = int64_t{1} << 31;
  json root = {{"sfm_data_version", "0.3"}, {"root_path", "/somewhere/images"}};
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const SceneView& view = scene.views[i];
    const Lens& lens = view.lens;
    const Coefficients c(lens);
    const json view_data = {{"local_path", ""}, {"filename", view.name}, {"width", lens.width}, {"height", lens.height},
                            {"id_view", i},     {"id_intrinsic", i},     {"id_pose", i + 100}};
    root["views"].push_back(
        {{"key", i},
         {"value", {{"polymorphic_id", 1073741824}, {"ptr_wrapper", {{"id", kFirst + 1}, {"data", view_data}}}}}});
    const json lens_data = {{"width", lens.width},
                            {"height", lens.height},
                            {"focal_length", lens.fx},
                            {"principal_point", {lens.cx - 0.5, lens.cy - 0.5}},
                            {"disto_t2", {c.k1, c.k2, c.k3, c.p1, c.p2}}};
    json value = {{"polymorphic_id", i == 0 ? kFirst + 1 : 1}, {"ptr_wrapper", {{"id", 2}, {"data", lens_data}}}};
    if (i == 0) value["polymorphic_name"] = "pinhole_brown_t2";
    root["intrinsics"].push_back({{"key", i}, {"value", value}});
    root["extrinsics"].push_back(
        {{"key", i + 100},
         {"value", {{"rotation", List(view.cam_from_world.rotation)}, {"center", List(CenterOf(view))}}}});
  }
  for (size_t p = 0; p < scene.points.size(); ++p) {
    json observations = json::array();
    for (const CameraIndex camera : scene.points[p].seen_by) {
      const Eigen::Vector2d pixel = PixelOf(scene, camera, scene.points[p].x_in_world);
      observations.push_back({{"key", camera}, {"value", {{"id_feat", 3}, {"x", {pixel.x() - 0.5, pixel.y() - 0.5}}}}});
    }
    root["structure"].push_back(
        {{"key", p}, {"value", {{"X", List(scene.points[p].x_in_world)}, {"observations", observations}}}});
  }
  return {{"sfm_data.json", root.dump()}};
}

SceneFiles AsMetashape(const Scene& scene) {
  std::string sensors;
  std::string cameras;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const SceneView& view = scene.views[i];
    const Lens& lens = view.lens;
    const Coefficients c(lens);
    const std::string resolution =
        absl::StrCat("<resolution width=\"", lens.width, "\" height=\"", lens.height, "\"/>");
    const auto value = [](const char* name, double number) {
      return absl::StrCat("<", name, ">", Digits(number), "</", name, ">");
    };
    absl::StrAppend(&sensors, "<sensor id=\"", i, "\" label=\"unknown\" type=\"frame\">", resolution,
                    "<calibration type=\"frame\" class=\"initial\">", resolution, "<f>1</f></calibration>",
                    "<calibration type=\"frame\" class=\"adjusted\">", resolution, value("f", lens.fy),
                    value("cx", lens.cx - lens.width / 2.0), value("cy", lens.cy - lens.height / 2.0),
                    value("b1", lens.fx - lens.fy), value("b2", lens.skew), value("k1", c.k1), value("k2", c.k2),
                    value("k3", c.k3), value("p1", c.p2), value("p2", c.p1), "</calibration></sensor>\n");
    const Matrix3d rotation = WorldFromCam(view);
    const Vector3d center = CenterOf(view);
    std::string transform;
    for (int row = 0; row < 3; ++row) {
      absl::StrAppend(&transform, Line(rotation.row(row)), " ", Digits(center[row]), " ");
    }
    const std::string label = view.name.substr(0, view.name.find('.'));
    absl::StrAppend(&cameras, "<camera id=\"", i, "\" sensor_id=\"", i, "\" label=\"", label,
                    "\" enabled=\"true\"><transform>", transform, "0 0 0 1</transform></camera>\n");
  }
  return {{"cameras.xml",
           absl::StrCat(
               "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<document version=\"1.4.0\">\n<chunk label=\"Chunk 1\" "
               "enabled=\"true\">\n<sensors>\n",
               sensors, "</sensors>\n<cameras><group id=\"0\">\n", cameras,
               "<camera id=\"99\" sensor_id=\"0\" label=\"unaligned\"/></group></cameras>\n<transform><scale>2"
               "</scale></transform>\n</chunk>\n</document>\n")}};
}

SceneFiles AsBlocksExchange(const Scene& scene) {
  const auto value = [](const std::string& name, double number) {
    return absl::StrCat("<", name, ">", Digits(number), "</", name, ">");
  };
  const auto vector = [&](const Vector3d& v) {
    return absl::StrCat(value("x", v.x()), value("y", v.y()), value("z", v.z()));
  };
  std::string groups;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const SceneView& view = scene.views[i];
    const Lens& lens = view.lens;
    const Coefficients c(lens);
    std::string rotation;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        rotation += value(absl::StrCat("M_", row, column), view.cam_from_world.rotation(row, column));
      }
    }
    absl::StrAppend(&groups, "<Photogroup><Name>g</Name><ImageDimensions><Width>", lens.width, "</Width><Height>",
                    lens.height, "</Height></ImageDimensions><CameraModelType>Perspective</CameraModelType>",
                    value("FocalLengthPixels", lens.fx),
                    "<CameraOrientation>XRightYDown</CameraOrientation><PrincipalPoint>", value("x", lens.cx),
                    value("y", lens.cy), "</PrincipalPoint>", value("AspectRatio", lens.fy / lens.fx),
                    value("Skew", lens.skew), "<Distortion>", value("K1", c.k1), value("K2", c.k2), value("K3", c.k3),
                    value("P1", c.p2), value("P2", c.p1), "</Distortion>\n<Photo><Id>", i, "</Id><ImagePath>D:\\set\\",
                    view.name, "</ImagePath><Pose><Rotation>", rotation, "</Rotation><Center>", vector(CenterOf(view)),
                    "</Center></Pose></Photo></Photogroup>\n");
  }
  std::string points;
  for (const SparsePoint& point : scene.points) {
    absl::StrAppend(&points, "<TiePoint><Position>", vector(point.x_in_world), "</Position><Color>",
                    value("Red", point.rgb[0] / 255.0), value("Green", point.rgb[1] / 255.0),
                    value("Blue", point.rgb[2] / 255.0), "</Color>");
    for (const CameraIndex camera : point.seen_by) {
      absl::StrAppend(&points, "<Measurement><PhotoId>", camera, "</PhotoId></Measurement>");
    }
    points += "</TiePoint>\n";
  }
  return {{"blocks.xml",
           absl::StrCat("<?xml version=\"1.0\"?>\n<BlocksExchange version=\"2.1\">\n<Block><Photogroups>\n", groups,
                        "</Photogroups><TiePoints>\n", points, "</TiePoints></Block>\n</BlocksExchange>\n")}};
}

// Cameras, in the frame of OpenGL, to the world that `applied` makes of the scene's, scaled.
SceneFiles AsTransforms(const Scene& scene, const Matrix3d& applied, const Vector3d& shift, double scale) {
  json root = {{"camera_model", "OPENCV"}, {"frames", json::array()}};
  for (const SceneView& view : scene.views) {
    const Lens& lens = view.lens;
    const Coefficients c(lens);
    const Matrix3d rotation = applied * WorldFromCam(view) * Vector3d(1, -1, -1).asDiagonal();
    const Vector3d center = scale * (applied * CenterOf(view) + shift);
    json matrix = json::array();
    for (int row = 0; row < 3; ++row) {
      matrix.push_back({rotation(row, 0), rotation(row, 1), rotation(row, 2), center[row]});
    }
    matrix.push_back({0, 0, 0, 1});
    root["frames"].push_back({{"file_path", "images/" + view.name},
                              {"transform_matrix", matrix},
                              {"w", lens.width},
                              {"h", lens.height},
                              {"fl_x", lens.fx},
                              {"fl_y", lens.fy},
                              {"cx", lens.cx},
                              {"cy", lens.cy},
                              {"k1", c.k1},
                              {"k2", c.k2},
                              {"k3", c.k3},
                              {"p1", c.p1},
                              {"p2", c.p2}});
  }
  if (!applied.isIdentity(0)) {
    json matrix = List(applied);
    for (int row = 0; row < 3; ++row) matrix[static_cast<size_t>(row)].push_back(shift[row]);
    root["applied_transform"] = matrix;
    root["applied_scale"] = scale;
  }
  return {{"transforms.json", root.dump()}};
}

SceneFiles AsBundler(const Scene& scene) {
  std::string text = absl::StrCat("# Bundle file v0.3\n", scene.views.size() + 1, " ", scene.points.size(), "\n");
  std::string list;
  const Matrix3d flip = Vector3d(1, -1, -1).asDiagonal();
  for (const SceneView& view : scene.views) {
    const Coefficients c(view.lens);
    absl::StrAppend(&text, Digits(view.lens.fx), " ", Digits(c.k1), " ", Digits(c.k2), "\n",
                    Rows(flip * view.cam_from_world.rotation, "\n"), "\n",
                    Line(Vector3d(flip * view.cam_from_world.translation)), "\n");
    absl::StrAppend(&list, view.name, " 0 ", view.lens.fx, "\n");
  }
  text += "0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n";  // not registered
  list += "unknown.jpg\n";
  for (const SparsePoint& point : scene.points) {
    absl::StrAppend(&text, Line(point.x_in_world), "\n", point.rgb[0], " ", point.rgb[1], " ", point.rgb[2], "\n",
                    point.seen_by.size());
    for (const CameraIndex camera : point.seen_by) {
      const Lens& lens = scene.views[static_cast<size_t>(camera)].lens;
      const Eigen::Vector2d pixel = PixelOf(scene, camera, point.x_in_world);
      absl::StrAppend(&text, " ", camera, " 5 ", Digits(pixel.x() - lens.width / 2.0), " ",
                      Digits(lens.height / 2.0 - pixel.y()));
    }
    text += "\n";
  }
  return {{"bundle.out", text}, {"list.txt", list}};
}

SceneFiles AsNvm(const Scene& scene) {
  std::string text = absl::StrCat("NVM_V3\n\n", scene.views.size(), "\n");
  for (const SceneView& view : scene.views) {
    const Eigen::Quaterniond q(view.cam_from_world.rotation);
    absl::StrAppend(&text, "images/", view.name, "\t", Digits(view.lens.fx), " ", Digits(q.w()), " ", Digits(q.x()),
                    " ", Digits(q.y()), " ", Digits(q.z()), " ", Line(CenterOf(view)), " 0 0\n");
  }
  absl::StrAppend(&text, "\n", scene.points.size(), "\n");
  for (const SparsePoint& point : scene.points) {
    absl::StrAppend(&text, Line(point.x_in_world), " ", point.rgb[0], " ", point.rgb[1], " ", point.rgb[2], " ",
                    point.seen_by.size());
    for (const CameraIndex camera : point.seen_by) absl::StrAppend(&text, " ", camera, " 4 -1.5 2");
    text += "\n";
  }
  return {{"model.nvm", text + "\n\n\n0\n\n#the last part\n0\n"}};
}

SceneFiles AsMvsNet(const Scene& scene) {
  SceneFiles files;
  for (const SceneView& view : scene.views) {
    const Lens& lens = view.lens;
    std::string text = "extrinsic\n";
    for (int row = 0; row < 3; ++row) {
      absl::StrAppend(&text, Line(view.cam_from_world.rotation.row(row)), " ",
                      Digits(view.cam_from_world.translation[row]), "\n");
    }
    absl::StrAppend(&text, "0 0 0 1\n\nintrinsic\n", Digits(lens.fx), " 0 ", Digits(lens.cx), "\n0 ", Digits(lens.fy),
                    " ", Digits(lens.cy), "\n0 0 1\n\n0.5 0.01 192 2.5\n");
    files["cams/" + view.name.substr(0, view.name.find('.')) + "_cam.txt"] = text;
  }

  return files;
}

template <typename T>
void Append(const T& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

void AppendText(const std::string& text, std::string* bytes) {
  Append(uint64_t{text.size()}, bytes);
  *bytes += text;
}

void AppendMatrix(const Matrix3d& m, std::string* bytes) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) Append(m(row, column), bytes);
  }
}

SceneFiles AsOpenMvs(const Scene& scene, uint32_t version, bool normalized) {
  std::string bytes = "MVSI";
  Append(version, &bytes);
  Append(uint32_t{0}, &bytes);
  // The camera of a platform need not be at its origin.
  const Matrix3d mount = Eigen::AngleAxisd(0.3, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const Vector3d mount_center(0.1, -0.2, 0.3);
  Append(uint64_t{scene.views.size()}, &bytes);
  for (const SceneView& view : scene.views) {
    const Lens& lens = view.lens;
    AppendText("platform", &bytes);
    Append(uint64_t{1}, &bytes);
    AppendText("camera", &bytes);
    if (version > 3) AppendText("RGB", &bytes);
    if (version > 0) {
      Append(normalized ? uint32_t{0} : static_cast<uint32_t>(lens.width), &bytes);
      Append(normalized ? uint32_t{0} : static_cast<uint32_t>(lens.height), &bytes);
    }
    Matrix3d k;
    k << lens.fx, 0, lens.cx - 0.5, 0, lens.fy, lens.cy - 0.5, 0, 0, 1;
    const double size = std::max(lens.width, lens.height);
    if (normalized || version == 0) k = Vector3d(1 / size, 1 / size, 1).asDiagonal() * k;
    AppendMatrix(k, &bytes);
    AppendMatrix(mount, &bytes);
    for (const double c : mount_center) Append(c, &bytes);
    // R = mount * R_pose, C = C_pose + R_pose^T * mount_center.
    const Matrix3d pose = mount.transpose() * view.cam_from_world.rotation;
    const Vector3d center = CenterOf(view) - pose.transpose() * mount_center;
    Append(uint64_t{1}, &bytes);
    AppendMatrix(pose, &bytes);
    for (const double c : center) Append(c, &bytes);
  }
  Append(uint64_t{scene.views.size() + 1}, &bytes);
  for (uint32_t i = 0; i <= scene.views.size(); ++i) {
    const bool registered = i < scene.views.size();
    AppendText(registered ? "images/" + scene.views[i].name : "images/unknown.png", &bytes);
    if (version > 4) AppendText("", &bytes);
    Append(registered ? i : uint32_t{0}, &bytes);
    Append(uint32_t{0}, &bytes);
    Append(registered ? uint32_t{0} : uint32_t{0xFFFFFFFF}, &bytes);
    if (version > 2) Append(i, &bytes);
    if (version > 6) {
      for (int k = 0; k < 3; ++k) Append(1.0F, &bytes);
      Append(uint64_t{1}, &bytes);
      for (int k = 0; k < 6; ++k) Append(1.0F, &bytes);
    }
  }
  Append(uint64_t{scene.points.size()}, &bytes);
  for (const SparsePoint& point : scene.points) {
    for (const double c : point.x_in_world) Append(static_cast<float>(c), &bytes);
    Append(uint64_t{point.seen_by.size()}, &bytes);
    for (const CameraIndex camera : point.seen_by) {
      Append(static_cast<uint32_t>(camera), &bytes);
      Append(1.0F, &bytes);
    }
  }
  Append(uint64_t{0}, &bytes);
  Append(uint64_t{scene.points.size()}, &bytes);
  for (const SparsePoint& point : scene.points) {
    for (const size_t channel : {2, 1, 0}) Append(point.rgb[channel], &bytes);
  }
  if (version > 0) bytes.append(3 * 8, '\0');
  return {{"scene.mvs", bytes}};
}

std::string Matrix4Of(const SceneView& view) {
  std::string text;
  const Matrix3d rotation = WorldFromCam(view);
  for (int row = 0; row < 3; ++row) {
    absl::StrAppend(&text, Line(rotation.row(row)), " ", Digits(CenterOf(view)[row]), "\n");
  }
  return text + "0 0 0 1\n";
}

SceneFiles AsTum(const Scene& scene) {
  SceneFiles files = {{"rgb.txt", "# timestamp filename\n"}, {"groundtruth.txt", "# timestamp tx ty tz qx qy qz qw\n"}};
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const double time = 1305031102.175304 + 0.1 * static_cast<double>(i);
    absl::StrAppend(&files["rgb.txt"], Digits(time), " images/", scene.views[i].name, "\n");
    const Eigen::Quaterniond q(WorldFromCam(scene.views[i]));
    for (const double later : {-0.03, 0.004}) {
      absl::StrAppend(&files["groundtruth.txt"], Digits(time + later), " ", Line(CenterOf(scene.views[i])), " ",
                      later < 0 ? "0 0 0 1" : Line(q.coeffs()), "\n");
    }
  }
  absl::StrAppend(&files["rgb.txt"], "1305039999 images/unknown.png\n");
  return files;
}

SceneFiles AsTanksAndTemples(const Scene& scene) {
  std::string text;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    absl::StrAppend(&text, i, " ", i, " 0\n", Matrix4Of(scene.views[i]));
  }
  return {{"Barn.log", text}};
}

// nerfstudio's, before and since 2024.
Matrix3d OldApplied() {
  Matrix3d m;
  m << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  return m;
}
Matrix3d NewApplied() {
  Matrix3d m;
  m << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return m;
}

template <typename... Values>
void AppendBinary(std::string& bytes, Values... values) {
  (AppendLittleEndian(values, bytes), ...);
}

SceneFiles AsColmapBinary(const Scene& scene) {
  SceneFiles files;
  std::string& cameras = files["sparse/0/cameras.bin"];
  std::string& images = files["sparse/0/images.bin"];
  AppendBinary(cameras, uint64_t{scene.views.size()});
  AppendBinary(images, uint64_t{scene.views.size()});
  for (uint32_t i = 0; i < scene.views.size(); ++i) {
    const Lens& lens = scene.views[i].lens;
    const bool is_pinhole = lens.model == Lens::Model::kPinhole;
    constexpr int32_t kPinholeModel = 1;
    constexpr int32_t kFullOpenCvModel = 6;
    AppendBinary(cameras, i + 1, is_pinhole ? kPinholeModel : kFullOpenCvModel, int64_t{lens.width},
                 int64_t{lens.height}, lens.fx, lens.fy, lens.cx, lens.cy);
    const Coefficients c(lens);
    if (!is_pinhole) AppendBinary(cameras, c.k1, c.k2, c.p1, c.p2, c.k3, 0.0, 0.0, 0.0);
    const Eigen::Quaterniond q(scene.views[i].cam_from_world.rotation);
    const Vector3d& t = scene.views[i].cam_from_world.translation;
    AppendBinary(images, i + 1, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z(), i + 1);
    images.append(scene.views[i].name.c_str(), scene.views[i].name.size() + 1);
    AppendBinary(images, uint64_t{0});
  }
  std::string& points = files["sparse/0/points3D.bin"];
  AppendBinary(points, uint64_t{scene.points.size()});
  for (uint64_t p = 0; p < scene.points.size(); ++p) {
    const SparsePoint& point = scene.points[p];
    const Vector3d& x = point.x_in_world;
    AppendBinary(points, p + 1, x.x(), x.y(), x.z(), point.rgb[0], point.rgb[1], point.rgb[2], 0.5,
                 uint64_t{point.seen_by.size()});
    for (const CameraIndex camera : point.seen_by) AppendBinary(points, static_cast<uint32_t>(camera + 1), uint32_t{0});
  }
  return files;
}

// Centres of pixels are at integers.
Matrix3d IntegerCalibration(const Lens& lens) {
  Matrix3d k = Matrix3d::Identity();
  k(0, 0) = lens.fx;
  k(1, 1) = lens.fy;
  k(0, 2) = lens.cx - 0.5;
  k(1, 2) = lens.cy - 0.5;
  return k;
}

SceneFiles AsMiddlebury(const Scene& scene) {
  std::string text = absl::StrCat(scene.views.size(), "\n");
  for (const SceneView& view : scene.views) {
    absl::StrAppend(&text, view.name, " ", Rows(IntegerCalibration(view.lens)), " ", Rows(view.cam_from_world.rotation),
                    " ", Line(view.cam_from_world.translation), "\n");
  }
  return {{"scene_par.txt", text}};
}

SceneFiles AsStrecha(const Scene& scene) {
  SceneFiles files;
  for (const SceneView& view : scene.views) {
    files["cameras/" + view.name + ".camera"] =
        absl::StrCat(Rows(IntegerCalibration(view.lens), "\n"), "\n0 0 0\n", Rows(WorldFromCam(view), "\n"), "\n",
                     Line(CenterOf(view)), "\n", view.lens.width, " ", view.lens.height, "\n");
  }
  return files;
}

SceneFiles AsSevenScenes(const Scene& scene) {
  SceneFiles files;
  for (const SceneView& view : scene.views) {
    std::string text;
    for (int row = 0; row < 3; ++row) {
      absl::StrAppend(&text, Line(WorldFromCam(view).row(row)), " ", Digits(CenterOf(view)[row]), "\n");
    }
    files[view.name.substr(0, view.name.find('.')) + ".pose.txt"] = text + "0 0 0 1\n";
  }
  return files;
}

constexpr LensLimits kBrown = {.radial = 3, .tangential = true};
constexpr LensLimits kPinhole = {};

}  // namespace

const std::vector<SceneWriter>& SceneWriters() {
  static const auto* const writers = new std::vector<SceneWriter>{
      {"colmap-binary", "", AsColmapBinary, kBrown},
      {"opensfm", "", AsOpenSfm, kBrown},
      {"alicevision", "1.2.11", [](const Scene& scene) { return AsAliceVision(scene, 11); }, kBrown},
      {"alicevision", "1.2.5", [](const Scene& scene) { return AsAliceVision(scene, 5); }, kBrown},
      {"alicevision", "1.2.4", [](const Scene& scene) { return AsAliceVision(scene, 4); }, kBrown},
      {"openmvg", "", AsOpenMvg, {.two_focals = false, .radial = 3, .tangential = true}},
      {"metashape", "", AsMetashape, kBrown, false},
      {"blocks-exchange", "", AsBlocksExchange, kBrown},
      {"openmvs", "7", [](const Scene& scene) { return AsOpenMvs(scene, 7, false); }, kPinhole, true, true, 1e-6},
      {"openmvs", "7, normalized K", [](const Scene& scene) { return AsOpenMvs(scene, 7, true); }, kPinhole, true, true,
       1e-6},
      {"openmvs", "0", [](const Scene& scene) { return AsOpenMvs(scene, 0, true); }, kPinhole, true, true, 1e-6},
      {"transforms-json", "",
       [](const Scene& scene) { return AsTransforms(scene, Matrix3d::Identity(), Vector3d::Zero(), 1); }, kBrown,
       false},
      {"transforms-json", "applied_transform of before 2024",
       [](const Scene& scene) { return AsTransforms(scene, OldApplied(), Vector3d(1, 2, 3), 1); }, kBrown, false},
      {"transforms-json", "applied_transform and applied_scale",
       [](const Scene& scene) { return AsTransforms(scene, NewApplied(), Vector3d(1, 2, 3), 0.25); }, kBrown, false},
      {"bundler", "", AsBundler, {.two_focals = false, .free_center = false, .radial = 2}},
      {"nvm", "", AsNvm, {.two_focals = false, .free_center = false}},
      {"mvsnet", "", AsMvsNet, kPinhole, false},
      {"middlebury", "", AsMiddlebury, kPinhole, false, true, 1e-9, ""},
      {"strecha", "", AsStrecha, kPinhole, false},
      {"7-scenes", "", AsSevenScenes, kPinhole, false, false, 1e-9, "", ".color.png"},
      {"tum", "", AsTum, kPinhole, false, false},
      {"tanks-and-temples", "", AsTanksAndTemples, kPinhole, false, false},
  };
  return *writers;
}

std::string PicturePath(const SceneWriter& writer, const std::string& name) {
  return absl::StrCat(writer.picture_folder, name.substr(0, name.rfind('.')), writer.picture_ending);
}

Scene SmallSceneWithin(const LensLimits& limits) {
  Lens lens = {.width = kSmallWidth, .height = kSmallHeight, .fx = 20, .fy = 20, .cx = 6, .cy = 5};
  if (limits.two_focals) lens.fy = 21;
  if (limits.free_center) {
    lens.cx = 6.25;
    lens.cy = 4.625;
  }
  if (limits.radial > 0) {
    lens.model = Lens::Model::kRadial;
    lens.coefficients = {-0.05, 0.01};
  }
  if (limits.tangential) {
    lens.model = limits.radial > 2 ? Lens::Model::kFullOpenCv : Lens::Model::kOpenCv;
    lens.coefficients = {-0.05, 0.01, 0.002, -0.003, limits.radial > 2 ? 0.004 : 0};
  }
  Scene scene{.format = "", .views = {}, .points = {}};
  for (int i = 0; i < 3; ++i) {
    SceneView view{.name = std::string(1, static_cast<char>('a' + i)) + ".png", .lens = lens};
    view.cam_from_world.rotation =
        Eigen::AngleAxisd(0.2 * i - 0.3, Vector3d(0.3, 1, 0.2 * i).normalized()).toRotationMatrix();
    view.cam_from_world.translation = {0.7 * i, 0.1, 5 + 0.3 * i};
    scene.views.push_back(view);
  }
  for (int p = 0; p < 4; ++p) {
    SparsePoint point{.x_in_world = {0.3 * p - 0.5, 0.25 * p - 0.4, 0.1 * p}, .rgb = {10, 20, 30}, .seen_by = {0, 2}};
    if (p % 2 == 1) point.seen_by = {0, 1, 2};
    scene.points.push_back(point);
  }
  return scene;
}

SceneFiles SmallSceneAs(const SceneWriter& writer) {
  SceneFiles files = writer.write(SmallSceneWithin(writer.limits));
  for (const char* name : {"a.png", "b.png", "c.png"}) files[PicturePath(writer, name)] = SmallPicture();
  return files;
}

}  // namespace meshwright
