// SPDX-License-Identifier: Apache-2.0
#include "tools/rendering/textured_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Geometry>
#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/base/little_endian.h"
#include "common/base/status_macros.h"
#include "common/image/decode.h"

namespace meshwright {
namespace {

using nlohmann::json;

// The parts of a GLB file.
class Glb {
 public:
  static absl::StatusOr<Glb> Parse(const std::string& bytes) {
    constexpr size_t kHead = 20;
    Glb glb;
    if (bytes.size() < kHead || bytes.compare(0, 4, "glTF") != 0) return Bad("no GLB");
    const size_t json_bytes = LoadLittleEndian<uint32_t>(bytes.data() + 12);
    if (bytes.size() < kHead + json_bytes + 8) return Bad("no buffer");
    glb.gltf = json::parse(bytes.substr(kHead, json_bytes), nullptr, false);
    if (!glb.gltf.is_object()) return Bad("no JSON");
    glb.buffer_ = bytes.substr(kHead + json_bytes + 8);
    return glb;
  }

  // Bytes of a view; throws json::exception for what is not there.
  std::string View(size_t number) const {
    const json& view = gltf.at("bufferViews").at(number);
    const auto offset = view.at("byteOffset").get<size_t>();
    const auto length = view.at("byteLength").get<size_t>();
    return offset <= buffer_.size() ? buffer_.substr(offset, length) : "";
  }

  // Rows of an accessor without stride, `columns` values each.
  template <typename T>
  std::vector<T> Values(size_t accessor_number, size_t columns) const {
    const json& accessor = gltf.at("accessors").at(accessor_number);
    const std::string bytes = View(accessor.at("bufferView").get<size_t>());
    std::vector<T> values(std::min(accessor.at("count").get<size_t>() * columns, bytes.size() / sizeof(T)));
    for (size_t i = 0; i < values.size(); ++i) values[i] = LoadLittleEndian<T>(bytes.data() + i * sizeof(T));
    return values;
  }

  static absl::Status Bad(const std::string& what) {
    return absl::InvalidArgumentError(absl::StrCat(what, ", expected a GLB with a texture atlas"));
  }

  json gltf;

 private:
  std::string buffer_;
};

absl::Status AppendPart(const Glb& glb, const json& primitive, TexturedModel& model) {
  const json& attributes = primitive.at("attributes");
  if (!attributes.contains("TEXCOORD_0")) return Glb::Bad("no texture coordinates");
  const auto positions = glb.Values<float>(attributes.at("POSITION").get<size_t>(), 3);
  const auto coordinates = glb.Values<float>(attributes.at("TEXCOORD_0").get<size_t>(), 2);
  const auto corners = glb.Values<uint32_t>(primitive.at("indices").get<size_t>(), 1);
  const auto first = static_cast<uint32_t>(model.mesh.positions.size());
  const size_t vertices = positions.size() / 3;
  if (coordinates.size() != 2 * vertices) return Glb::Bad("texture coordinates of other vertices");
  for (size_t v = 0; v < vertices; ++v) {
    model.mesh.positions.emplace_back(positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]);
    model.texture_coordinates.emplace_back(coordinates[2 * v], coordinates[2 * v + 1]);
  }
  const json& material = glb.gltf.at("materials").at(primitive.at("material").get<size_t>());
  const auto texture = material.at("pbrMetallicRoughness").at("baseColorTexture").at("index").get<size_t>();
  const auto page = glb.gltf.at("textures").at(texture).at("source").get<size_t>();
  if (page >= model.pages.size()) return Glb::Bad("a texture without picture");
  for (size_t i = 0; i + 2 < corners.size(); i += 3) {
    if (std::max({corners[i], corners[i + 1], corners[i + 2]}) >= vertices) return Glb::Bad("a corner without vertex");
    model.mesh.faces.push_back({first + corners[i], first + corners[i + 1], first + corners[i + 2]});
    model.pages_of_faces.push_back(static_cast<int32_t>(page));
  }
  return absl::OkStatus();
}

absl::StatusOr<TexturedModel> Decode(const Glb& glb) {
  TexturedModel model;
  try {
    if (!glb.gltf.contains("images")) return Glb::Bad("no pictures");
    for (const json& image : glb.gltf.at("images")) {
      MW_ASSIGN_OR_RETURN(ColorImage page,
                          DecodeImageBytes(glb.View(image.at("bufferView").get<size_t>()), "a picture in it"));
      model.pages.push_back(std::move(page));
    }
    // The node turns the mesh half around X: its translation is the offset, turned alike.
    if (const json& node = glb.gltf.at("nodes").at(0); node.contains("translation")) {
      const auto translation = node.at("translation").get<std::array<double, 3>>();
      model.mesh.offset = {translation[0], -translation[1], -translation[2]};
    }
    for (const json& mesh : glb.gltf.at("meshes")) {
      for (const json& primitive : mesh.at("primitives")) MW_RETURN_IF_ERROR(AppendPart(glb, primitive, model));
    }
  } catch (const json::exception& error) {
    return Glb::Bad(error.what());
  }
  return model;
}

// Linear between pixels; `pixel` in the page's pixel coordinates.
Eigen::Vector3f SamplePage(const ColorImage& page, const Eigen::Vector2f& pixel) {
  const float x = std::clamp(pixel.x() - 0.5F, 0.0F, static_cast<float>(page.width - 1));
  const float y = std::clamp(pixel.y() - 0.5F, 0.0F, static_cast<float>(page.height - 1));
  const int x0 = std::clamp(static_cast<int>(x), 0, std::max(0, page.width - 2));
  const int y0 = std::clamp(static_cast<int>(y), 0, std::max(0, page.height - 2));
  const float right = x - static_cast<float>(x0);
  const float down = y - static_cast<float>(y0);
  const auto at = [&](int dx, int dy) {
    const std::array<uint8_t, 3> rgb = page.At(std::min(x0 + dx, page.width - 1), std::min(y0 + dy, page.height - 1));
    return Eigen::Vector3f(rgb[0], rgb[1], rgb[2]);
  };
  return (1 - down) * ((1 - right) * at(0, 0) + right * at(1, 0)) + down * ((1 - right) * at(0, 1) + right * at(1, 1));
}

Eigen::Vector2f PixelOf(const TexturedModel& model, int32_t face, uint32_t vertex) {
  const ColorImage& page = model.pages[static_cast<size_t>(model.pages_of_faces[static_cast<size_t>(face)])];
  return model.texture_coordinates[vertex].cwiseProduct(
      Eigen::Vector2f(static_cast<float>(page.width), static_cast<float>(page.height)));
}

// One side of an edge of the surface, whatever vertices stand for its ends.
struct EdgeSide {
  int32_t face = 0;
  std::array<uint32_t, 3> corners = {};  // the edge from the first to the second
};

// Grey level half a pixel inside the face, `place` along the edge.
float GreyBeside(const TexturedModel& model, const EdgeSide& side, float place) {
  const Eigen::Vector2f a = PixelOf(model, side.face, side.corners[0]);
  const Eigen::Vector2f b = PixelOf(model, side.face, side.corners[1]);
  const Eigen::Vector2f c = PixelOf(model, side.face, side.corners[2]);
  const Eigen::Vector2f along = b - a;
  Eigen::Vector2f inwards(-along.y(), along.x());
  if (inwards.dot(c - a) < 0) inwards = -inwards;
  const Eigen::Vector2f pixel = a + place * along + 0.5F * inwards.normalized();
  const ColorImage& page = model.pages[static_cast<size_t>(model.pages_of_faces[static_cast<size_t>(side.face)])];
  return SamplePage(page, pixel).mean();
}

}  // namespace

absl::StatusOr<TexturedModel> ReadTexturedGlb(const std::string& path) {
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  const absl::StatusOr<Glb> glb = Glb::Parse(bytes);
  absl::StatusOr<TexturedModel> model = glb.ok() ? Decode(*glb) : absl::StatusOr<TexturedModel>(glb.status());
  if (model.ok()) return model;
  return absl::InvalidArgumentError(absl::StrCat(path, ": ", std::string(model.status().message())));
}

Eigen::Vector3f ColorAt(const TexturedModel& model, int32_t face, float u, float v) {
  const std::array<uint32_t, 3>& corners = model.mesh.faces[static_cast<size_t>(face)];
  const ColorImage& page = model.pages[static_cast<size_t>(model.pages_of_faces[static_cast<size_t>(face)])];
  const Eigen::Vector2f pixel = (1 - u - v) * PixelOf(model, face, corners[0]) + u * PixelOf(model, face, corners[1]) +
                                v * PixelOf(model, face, corners[2]);
  return SamplePage(page, pixel);
}

ColorImage TexturedModelRenderer::Render(const Camera& camera, const std::array<uint8_t, 3>& background,
                                         ThreadPool& pool) const {
  const Eigen::Vector3d center = camera.center_in_world();
  const Eigen::Matrix3d world_from_cam = camera.cam_from_world.rotation.transpose();
  ColorImage image{camera.width, camera.height, {}};
  image.rgb.resize(3 * static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height));
  pool.ParallelFor(camera.height, 4, [&](int64_t begin, int64_t end) {
    auto* out = &image.rgb[3 * static_cast<size_t>(begin) * static_cast<size_t>(camera.width)];
    for (int row = static_cast<int>(begin); row < static_cast<int>(end); ++row) {
      for (int column = 0; column < camera.width; ++column) {
        std::array<Eigen::Vector3d, 4> directions;
        for (size_t i = 0; i < 4; ++i) {
          directions[i] =
              world_from_cam * camera.RayInCam(column + (i % 2 == 0 ? 0.25 : 0.75), row + (i < 2 ? 0.25 : 0.75));
        }
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        for (const RayHit& hit : caster_.Cast4(center, directions)) {
          sum += hit.ok() ? ColorAt(model_, hit.face, static_cast<float>(hit.u), static_cast<float>(hit.v))
                          : Eigen::Vector3f(background[0], background[1], background[2]);
        }
        for (int channel = 0; channel < 3; ++channel) {
          *out++ = static_cast<uint8_t>(std::clamp(0.25F * sum[channel] + 0.5F, 0.0F, 255.0F));
        }
      }
    }
  });
  return image;
}

EdgeJumps MeasureEdgeJumps(const TexturedModel& model) {
  // Vertices are cut at seams: positions tell which are the same.
  std::map<std::array<float, 3>, uint32_t> number_of_position;
  std::vector<uint32_t> numbers;
  for (const Eigen::Vector3f& x : model.mesh.positions) {
    const auto next = static_cast<uint32_t>(number_of_position.size());
    numbers.push_back(number_of_position.try_emplace({x.x(), x.y(), x.z()}, next).first->second);
  }
  std::map<std::pair<uint32_t, uint32_t>, EdgeSide> open;
  EdgeJumps jumps;
  int64_t others = 0;
  for (size_t f = 0; f < model.mesh.faces.size(); ++f) {
    for (size_t k = 0; k < 3; ++k) {
      const std::array<uint32_t, 3>& face = model.mesh.faces[f];
      const EdgeSide here = {static_cast<int32_t>(f), {face[k], face[(k + 1) % 3], face[(k + 2) % 3]}};
      const auto key = std::pair(numbers[here.corners[0]], numbers[here.corners[1]]);
      const auto found = open.find({key.second, key.first});
      if (found == open.end()) {
        open.emplace(key, here);
        continue;
      }
      const EdgeSide& there = found->second;  // runs the other way
      double jump = 0;
      for (const float place : {0.25F, 0.5F, 0.75F}) {
        jump += std::abs(GreyBeside(model, here, place) - GreyBeside(model, there, 1 - place)) / 3.0;
      }
      const bool is_seam = here.corners[0] != there.corners[1] || here.corners[1] != there.corners[0];
      (is_seam ? jumps.at_seams : jumps.within_charts) += jump;
      ++(is_seam ? jumps.seams : others);
      open.erase(found);
    }
  }
  if (jumps.seams > 0) jumps.at_seams /= static_cast<double>(jumps.seams);
  if (others > 0) jumps.within_charts /= static_cast<double>(others);
  return jumps;
}

}  // namespace meshwright
