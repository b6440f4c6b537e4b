# SPDX-License-Identifier: Apache-2.0
# Run with cmake -P: writes OUTPUT, a C++ file that defines
#   const std::vector<std::pair<std::string, std::string>>& SYMBOL();   // (file name, content), sorted by name
# in namespace meshwright, from the text files INPUTS (a ;-list).
set(entries "")
list(SORT INPUTS)
foreach(input IN LISTS INPUTS)
  file(READ "${input}" content)
  get_filename_component(name "${input}" NAME)
  string(APPEND entries "      {\"${name}\", R\"embedded(${content})embedded\"},\n")
endforeach()
file(WRITE "${OUTPUT}" "// Made by cmake/EmbedText.cmake.
#include <string>
#include <utility>
#include <vector>

namespace meshwright {

const std::vector<std::pair<std::string, std::string>>& ${SYMBOL}();
const std::vector<std::pair<std::string, std::string>>& ${SYMBOL}() {
  static const auto* const files = new std::vector<std::pair<std::string, std::string>>{
${entries}  };
  return *files;
}

}  // namespace meshwright
")
