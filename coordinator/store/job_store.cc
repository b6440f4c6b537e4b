#include "coordinator/store/job_store.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

namespace meshwright {

std::string JoinCameraIndices(const std::vector<CameraIndex>& cameras) { return absl::StrJoin(cameras, ","); }

absl::StatusOr<std::vector<CameraIndex>> SplitCameraIndices(const std::string& text) {
  std::vector<CameraIndex> cameras;
  if (text.empty()) return cameras;
  for (const auto& part : absl::StrSplit(text, ',')) {
    CameraIndex camera = 0;
    if (!absl::SimpleAtoi(part, &camera)) {
      return absl::DataLossError(absl::StrCat("camera indices expected, got \"", text, "\""));
    }
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace meshwright
