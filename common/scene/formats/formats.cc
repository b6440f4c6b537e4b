// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/formats.h"

#include "common/scene/formats/alicevision.h"
#include "common/scene/formats/assemble.h"
#include "common/scene/formats/blocks_exchange.h"
#include "common/scene/formats/bundler.h"
#include "common/scene/formats/colmap_binary.h"
#include "common/scene/formats/colmap_model.h"
#include "common/scene/formats/colmap_text.h"
#include "common/scene/formats/metashape.h"
#include "common/scene/formats/middlebury.h"
#include "common/scene/formats/mvsnet.h"
#include "common/scene/formats/nvm.h"
#include "common/scene/formats/openmvg.h"
#include "common/scene/formats/openmvs.h"
#include "common/scene/formats/opensfm.h"
#include "common/scene/formats/pose_folders.h"
#include "common/scene/formats/strecha.h"
#include "common/scene/formats/transforms_json.h"
#include "common/scene/formats/xml_fields.h"

namespace meshwright {

const std::vector<SceneFormat>& SceneFormats() {
  static const std::vector<SceneFormat> formats = {
      {"colmap-binary", ColmapModelFiles("bin"), [](const std::string& path) { return FindColmapModels(path, "bin"); },
       ImportColmapBinary},
      {"colmap-text", ColmapModelFiles("txt"), [](const std::string& path) { return FindColmapModels(path, "txt"); },
       ImportColmapText},
      {"opensfm", "reconstruction.json here or in opensfm/", FindOpenSfm, ImportOpenSfm},
      {"alicevision", "*.sfm", [](const std::string& path) { return FirstFileEndingIn(path, ".sfm"); },
       ImportAliceVision},
      {"openmvg", "sfm_data.json",
       [](const std::string& path) {
         const std::string file = JoinPath(path, "sfm_data.json");
         return IsFile(file) ? file : std::string();
       },
       ImportOpenMvg},
      {"metashape", "*.xml with cameras of Metashape",
       [](const std::string& path) { return FindXmlWithRoot(path, "<document"); }, ImportMetashape},
      {"blocks-exchange", "*.xml of BlocksExchange",
       [](const std::string& path) { return FindXmlWithRoot(path, "<BlocksExchange"); }, ImportBlocksExchange},
      {"openmvs", "*.mvs", [](const std::string& path) { return FirstFileEndingIn(path, ".mvs"); }, ImportOpenMvs},
      {"transforms-json", "transforms.json or transforms_train.json", FindTransformsJson, ImportTransformsJson},
      {"bundler", "*.out of Bundler here or in bundle/", FindBundler, ImportBundler},
      {"nvm", "*.nvm", [](const std::string& path) { return FirstFileEndingIn(path, ".nvm"); }, ImportNvm},
      {"mvsnet", "cams/*_cam.txt", FindMvsNet, ImportMvsNet},
      {"middlebury", "*_par.txt",
       [](const std::string& path) { return FilesEndingIn(path, "_par.txt").empty() ? std::string() : path; },
       ImportMiddlebury},
      {"strecha", "*.camera here, in cameras/ or in gt_dense_cameras/",
       [](const std::string& path) { return FindStrechaCameras(path).empty() ? std::string() : path; }, ImportStrecha},
      {"7-scenes", "*.pose.txt", FindSevenScenes, ImportSevenScenes},
      {"tum", "rgb.txt and groundtruth.txt", FindTum, ImportTum},
      {"tanks-and-temples", "*.log of poses", FindTanksAndTemples, ImportTanksAndTemples},
  };
  return formats;
}

}  // namespace meshwright
