// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "common/image/color_image.h"
#include "common/mesh/formats/mesh_format.h"

namespace meshwright {

// The faces that one page of a texture atlas colours.
struct TexturePart {
  std::vector<Eigen::Vector3f> positions;            // scene units, world frame less the offset
  std::vector<Eigen::Vector2f> texture_coordinates;  // glTF's: (0, 0) is the page's top-left corner, (1, 1) the other
  std::vector<std::array<uint32_t, 3>> faces;        // counter-clockwise seen from outside
};

struct TexturePictures {
  bool png = false;       // without loss
  int jpeg_quality = 92;  // 1 .. 100
};

// Writes a textured mesh page by page: GLB with its pictures inside, or OBJ with NAME.mtl and NAME_0.jpg ... beside it.
class TexturedMeshWriter {
 public:
  // `format.textured` must be set. `offset`: world = position + offset. Errors of AtomicFile; OutOfRange beyond the 4
  // GiB of GLB. Compressed parts are held in memory until the head is written.
  static absl::StatusOr<std::unique_ptr<TexturedMeshWriter>> Create(const MeshFormat& format, const std::string& path,
                                                                    std::vector<TexturePart> parts,
                                                                    const Eigen::Vector3d& offset,
                                                                    const TexturePictures& pictures,
                                                                    const MeshWriteOptions& options = {});
  virtual ~TexturedMeshWriter() = default;

  // One for each part, in their order.
  virtual absl::Status AppendPage(const ColorImage& page) = 0;
  // After the last page. Until then `path` is not there.
  virtual absl::Status Commit() = 0;
};

}  // namespace meshwright
