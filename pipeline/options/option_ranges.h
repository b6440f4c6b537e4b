#pragma once

#include <string>

namespace meshwright {

// The options of a reconstruction as GET /v1/options tells them: name, group, type, default, documentation and the
// values that are accepted beside the defaults of all others. The latter are found by asking ReconstructionOptions, so
// they cannot differ from what is checked.
std::string DescribeOptionsWithRanges();

}  // namespace meshwright
