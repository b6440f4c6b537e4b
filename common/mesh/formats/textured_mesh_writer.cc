// SPDX-License-Identifier: Apache-2.0
#include "common/mesh/formats/textured_mesh_writer.h"

#include <filesystem>
#include <limits>
#include <utility>

#include <Eigen/Geometry>
#include <absl/strings/str_cat.h>

#include "common/base/check.h"
#include "common/image/encode.h"
#include "common/json/json_text.h"
#include "common/mesh/formats/glb_compression.h"
#include "common/mesh/formats/glb_container.h"
#include "common/mesh/formats/obj_text.h"
#include "common/mesh/formats/row_writer.h"

namespace meshwright {
namespace {

using nlohmann::json;

std::string Encode(const ColorImage& page, const TexturePictures& pictures) {
  return pictures.png ? EncodePng(page) : EncodeJpeg(page, pictures.jpeg_quality);
}

// The description comes first in a GLB, and says how long the pictures are: room is kept for it until they are known.
class GlbWriter final : public TexturedMeshWriter {
 public:
  GlbWriter(std::string path, std::vector<TexturePart> parts, const Eigen::Vector3d& offset,
            const TexturePictures& pictures, bool compressed, AtomicFile file)
      : path_(std::move(path)), parts_(std::move(parts)), offset_(offset), pictures_(pictures), file_(std::move(file)) {
    if (compressed) Compress();
  }

  absl::Status Begin() {
    constexpr uint64_t kLongest = 999'999'999;  // bytes of a picture, as long as a number can be
    const glb::Description longest = Describe(std::vector<uint64_t>(parts_.size(), kLongest));
    json_bytes_ = JsonText(longest.gltf).size();
    MW_ASSIGN_OR_RETURN(const std::string head, Head(std::vector<uint64_t>(parts_.size(), 0)));
    MW_RETURN_IF_ERROR(file_.Append(head));
    for (const glb::CompressedPrimitive& part : compressed_) MW_RETURN_IF_ERROR(file_.Append(part.bytes()));
    if (is_compressed()) return absl::OkStatus();
    for (const TexturePart& part : parts_) {
      MW_RETURN_IF_ERROR(AppendRows(
          part.positions.size(), [&](size_t i, std::string& out) { AppendVector(part.positions[i], out); }, file_));
      const auto append_coordinates = [&](size_t i, std::string& out) {
        for (int k = 0; k < 2; ++k) AppendLittleEndian(part.texture_coordinates[i][k], out);
      };
      MW_RETURN_IF_ERROR(AppendRows(part.positions.size(), append_coordinates, file_));
      const auto append_face = [&](size_t i, std::string& out) {
        for (const uint32_t corner : part.faces[i]) AppendLittleEndian(corner, out);
      };
      MW_RETURN_IF_ERROR(AppendRows(part.faces.size(), append_face, file_));
    }
    return absl::OkStatus();
  }

  absl::Status AppendPage(const ColorImage& page) override {
    MW_CHECK(picture_bytes_.size() < parts_.size());
    std::string bytes = Encode(page, pictures_);
    picture_bytes_.push_back(bytes.size());
    bytes.resize((bytes.size() + 3) / 4 * 4, '\0');
    return file_.Append(bytes);
  }

  absl::Status Commit() override {
    MW_CHECK(picture_bytes_.size() == parts_.size());
    MW_ASSIGN_OR_RETURN(const std::string head, Head(picture_bytes_));
    MW_RETURN_IF_ERROR(file_.WriteAt(0, head));
    return file_.Commit();
  }

 private:
  bool is_compressed() const { return !compressed_.empty(); }

  // All parts are on one lattice: they have one node.
  void Compress() {
    Eigen::AlignedBox3f box;
    size_t vertices = 0;
    for (const TexturePart& part : parts_) {
      for (const Eigen::Vector3f& x : part.positions) box.extend(x);
      vertices += part.positions.size();
    }
    lattice_ = glb::LatticeFor(box.min(), box.max(), vertices);
    for (TexturePart& part : parts_) {
      compressed_.emplace_back(glb::PrimitiveArrays{.positions = std::move(part.positions),
                                                    .normals = {},
                                                    .colors = {},
                                                    .texture_coordinates = std::move(part.texture_coordinates),
                                                    .faces = std::move(part.faces)},
                               lattice_);
      part = {};
    }
  }

  absl::StatusOr<std::string> Head(const std::vector<uint64_t>& picture_bytes) const {
    return glb::Head(Describe(picture_bytes), json_bytes_, path_);
  }

  glb::Description Describe(const std::vector<uint64_t>& picture_bytes) const {
    glb::Description description = glb::NewDescription();
    json& gltf = description.gltf;
    json primitives = json::array();
    for (size_t i = 0; i < parts_.size(); ++i) {
      json primitive = is_compressed() ? compressed_[i].Describe(description) : DescribePart(parts_[i], description);
      primitive["material"] = i;
      primitives.push_back(std::move(primitive));
    }
    for (size_t i = 0; i < parts_.size(); ++i) {
      const size_t view = glb::AddView(picture_bytes[i], 0, description);
      description.buffer_bytes = (description.buffer_bytes + 3) / 4 * 4;
      gltf["images"].push_back({{"bufferView", view}, {"mimeType", pictures_.png ? "image/png" : "image/jpeg"}});
      gltf["textures"].push_back({{"sampler", 0}, {"source", i}});
      gltf["materials"].push_back(
          {{"pbrMetallicRoughness",
            {{"baseColorTexture", {{"index", i}}}, {"metallicFactor", 0}, {"roughnessFactor", 1}}},
           {"doubleSided", true},
           {"extensions", {{"KHR_materials_unlit", json::object()}}}});
    }
    constexpr int kLinear = 9729;
    constexpr int kLinearMipmapLinear = 9987;
    constexpr int kClampToEdge = 33071;
    gltf["samplers"] = {
        {{"magFilter", kLinear}, {"minFilter", kLinearMipmapLinear}, {"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}}};
    gltf["scenes"][0]["nodes"] = {0};
    gltf["nodes"] = {is_compressed() ? glb::CompressedMeshNode(offset_, lattice_) : glb::MeshNode(offset_)};
    gltf["meshes"] = {{{"primitives", std::move(primitives)}}};
    if (is_compressed()) {
      glb::DescribeCompressedBuffers(description);
    } else {
      gltf["extensionsUsed"] = {"KHR_materials_unlit"};
      gltf["buffers"] = {{{"byteLength", description.buffer_bytes}}};
    }
    return description;
  }

  static json DescribePart(const TexturePart& part, glb::Description& description) {
    const uint64_t vertices = part.positions.size();
    const size_t positions =
        glb::AddAccessor(vertices, 3 * sizeof(float), glb::kFloat, "VEC3", glb::kArrayBuffer, description);
    Eigen::Vector3f low = part.positions.front();
    Eigen::Vector3f high = low;
    for (const Eigen::Vector3f& x : part.positions) {
      low = low.cwiseMin(x);
      high = high.cwiseMax(x);
    }
    json& accessor = description.gltf["accessors"][positions];
    accessor["min"] = {low.x(), low.y(), low.z()};
    accessor["max"] = {high.x(), high.y(), high.z()};
    const size_t coordinates =
        glb::AddAccessor(vertices, 2 * sizeof(float), glb::kFloat, "VEC2", glb::kArrayBuffer, description);
    const size_t corners = glb::AddAccessor(3 * part.faces.size(), sizeof(uint32_t), glb::kUnsignedInt, "SCALAR",
                                            glb::kElementArrayBuffer, description);
    return {{"mode", glb::kTriangles},
            {"attributes", {{"POSITION", positions}, {"TEXCOORD_0", coordinates}}},
            {"indices", corners}};
  }

  const std::string path_;
  std::vector<TexturePart> parts_;
  glb::PositionLattice lattice_;
  std::vector<glb::CompressedPrimitive> compressed_;  // of the parts, which are empty then; none: not compressed
  const Eigen::Vector3d offset_;
  const TexturePictures pictures_;
  AtomicFile file_;
  size_t json_bytes_ = 0;
  std::vector<uint64_t> picture_bytes_;
};

// Material names and file names in OBJ and MTL end at a blank.
std::string WithoutBlanks(std::string name) {
  for (char& c : name) {
    if (c == ' ' || c == '\t') c = '_';
  }
  return name;
}

class ObjWriter final : public TexturedMeshWriter {
 public:
  ObjWriter(const std::string& path, const TexturePictures& pictures, AtomicFile file)
      : folder_(std::filesystem::path(path).parent_path().string()),
        name_(WithoutBlanks(std::filesystem::path(path).stem().string())),
        pictures_(pictures),
        file_(std::move(file)) {}

  absl::Status Begin(const std::vector<TexturePart>& parts, const Eigen::Vector3d& offset) {
    MW_RETURN_IF_ERROR(file_.Append(absl::StrCat("# Meshwright\nmtllib ", name_, ".mtl\n")));
    uint64_t first = 1;  // numbers count on from part to part
    for (size_t i = 0; i < parts.size(); ++i) {
      const TexturePart& part = parts[i];
      const auto append_position = [&](size_t v, std::string& text) {
        obj::AppendPosition(part.positions[v], offset, text);
        text += '\n';
      };
      const auto append_coordinates = [&](size_t v, std::string& text) {
        const Eigen::Vector2f& coordinates = part.texture_coordinates[v];
        obj::AppendNumbers("vt", Eigen::Vector2f(coordinates.x(), 1 - coordinates.y()), text);
        text += '\n';
      };
      const auto append_face = [&](size_t f, std::string& text) {
        text += 'f';
        for (const uint32_t corner : part.faces[f]) absl::StrAppend(&text, " ", first + corner, "/", first + corner);
        text += '\n';
      };
      MW_RETURN_IF_ERROR(AppendRows(part.positions.size(), append_position, file_));
      MW_RETURN_IF_ERROR(AppendRows(part.positions.size(), append_coordinates, file_));
      MW_RETURN_IF_ERROR(file_.Append(absl::StrCat("usemtl page_", i, "\n")));
      MW_RETURN_IF_ERROR(AppendRows(part.faces.size(), append_face, file_));
      first += part.positions.size();
    }
    return absl::OkStatus();
  }

  absl::Status AppendPage(const ColorImage& page) override {
    const std::string picture = absl::StrCat(name_, "_", pages_, pictures_.png ? ".png" : ".jpg");
    absl::StrAppend(&materials_, "newmtl page_", pages_, "\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd ", picture,
                    "\n");
    ++pages_;
    return WriteFileAtomically(Beside(picture), Encode(page, pictures_));
  }

  absl::Status Commit() override {
    MW_RETURN_IF_ERROR(WriteFileAtomically(Beside(name_ + ".mtl"), materials_));
    return file_.Commit();
  }

 private:
  std::string Beside(const std::string& name) const { return (std::filesystem::path(folder_) / name).string(); }

  const std::string folder_;
  const std::string name_;
  const TexturePictures pictures_;
  AtomicFile file_;
  int pages_ = 0;
  std::string materials_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<TexturedMeshWriter>> TexturedMeshWriter::Create(
    const MeshFormat& format, const std::string& path, std::vector<TexturePart> parts, const Eigen::Vector3d& offset,
    const TexturePictures& pictures, const MeshWriteOptions& options) {
  MW_CHECK(format.textured && (!options.compressed || format.compressible));
  MW_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  if (std::string(format.name) == "obj") {
    auto writer = std::make_unique<ObjWriter>(path, pictures, std::move(file));
    MW_RETURN_IF_ERROR(writer->Begin(parts, offset));
    return writer;
  }
  auto writer =
      std::make_unique<GlbWriter>(path, std::move(parts), offset, pictures, options.compressed, std::move(file));
  MW_RETURN_IF_ERROR(writer->Begin());
  return writer;
}

}  // namespace meshwright
