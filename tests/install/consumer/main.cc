// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <iostream>
#include <optional>

#include "pipeline/library/library.h"

#include "common/mesh/ply.h"
#include "common/scene/formats/import.h"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const auto scene = meshwright::ImportScene(argv[1]);
  if (!scene.ok()) return std::cerr << scene.status() << "\n", 1;
  const auto done = meshwright::Reconstruct(*scene, {.output_path = argv[2], .options_json = R"({"lattice-step": 1})"});
  if (!done.ok()) return std::cerr << done.status() << "\n", 1;
  const auto mesh = meshwright::ReadPly(argv[2]);
  if (!mesh.ok()) return std::cerr << mesh.status() << "\n", 1;
  std::printf("%zu photographs, %zu vertices, %zu faces\n", scene->views.size(), mesh->positions.size(),
              mesh->faces.size());
  return mesh->faces.empty() || static_cast<size_t>(done->faces) != mesh->faces.size() ? 1 : 0;
}
