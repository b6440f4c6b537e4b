// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/lens_and_pose.h"

namespace meshwright {

void SetDistortion(const RadialTangential& distortion, Lens* lens) {
  const auto& [k1, k2, k3, k4, p1, p2] = distortion;
  if (k4 != 0) {
    lens->model = Lens::Model::kBrown;
    lens->coefficients = {k1, k2, p1, p2, k3, k4};
  } else if (k3 != 0) {
    lens->model = Lens::Model::kFullOpenCv;
    lens->coefficients = {k1, k2, p1, p2, k3};
  } else if (p1 != 0 || p2 != 0) {
    lens->model = Lens::Model::kOpenCv;
    lens->coefficients = {k1, k2, p1, p2};
  } else if (k1 != 0 || k2 != 0) {
    lens->model = Lens::Model::kRadial;
    lens->coefficients = {k1, k2};
  } else {
    lens->model = Lens::Model::kPinhole;
    lens->coefficients = {};
  }
}

}  // namespace meshwright
