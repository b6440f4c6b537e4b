// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

namespace meshwright {

// What a file among the images of a task is.
enum class OdmFileKind {
  kPhotograph,
  kCameras,  // may be, or belong to, a model of cameras: whoever reads scenes decides
  kUnused,   // what ODM has for other purposes: ground control, alignment, masks, seeds
};
OdmFileKind KindOfFile(const std::string& name);

// Without the folders that it may name. InvalidArgument when nothing good is left.
absl::StatusOr<std::string> BaseName(const std::string& file_name);

// x.jpg -> x_.jpg, as NodeODM names a second file of one name.
std::string OtherName(const std::string& name);

}  // namespace meshwright
