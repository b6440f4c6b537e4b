// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "tools/raycast/mesh_ray_caster.h"
#include "tools/synthetic/synthetic_scene.h"
#include "tools/synthetic/world.h"

#include "common/base/thread_pool.h"
#include "common/geometry/camera.h"
#include "common/image/color_image.h"

namespace meshwright {

// Photographs of the world: Lambertian surfaces under one sun with cast shadows, lamps and a sky, highlights of the
// lamps on what is glossy, four jittered samples in a pixel, an exposure of its own for each photograph, sensor noise,
// gamma 2, compression. `caster` is of world.mesh.
std::vector<ColorImage> TakePhotographs(const World& world, const MeshRayCaster& caster,
                                        const std::vector<Camera>& cameras, const SyntheticOptions& options,
                                        ThreadPool& pool);

// Sparse points as structure from motion leaves them: at textured places that at least three cameras see from similar
// directions, off by 0.3 px, some of the sightings missed.
std::vector<SparsePoint> FindSparsePoints(const MeshRayCaster& caster, const std::vector<Camera>& cameras,
                                          const std::vector<ColorImage>& images, const SyntheticOptions& options,
                                          ThreadPool& pool);

}  // namespace meshwright
