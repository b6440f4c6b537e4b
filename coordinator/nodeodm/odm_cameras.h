// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "common/scene/scene.h"

namespace meshwright {

// A scene in the words of ODM, for all.zip. Coordinates are the scene's: no places on earth are invented.

// cameras.json: each lens once, in OpenSfM's normalised units (px / longest side, from the middle of the picture).
nlohmann::ordered_json OdmCameras(const Scene& scene);
// odm_report/shots.geojson: a feature without geometry for each photograph, with `translation` (the camera's place) and
// `rotation` (of cam_from_world, axis * angle in radians).
nlohmann::ordered_json OdmShots(const Scene& scene);
// images.json: a list with file name and size.
nlohmann::ordered_json OdmImages(const Scene& scene);

}  // namespace meshwright
