// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace meshwright {

// Names of files are bytes; JSON, Protocol Buffers and databases hold text in UTF-8 and refuse, or die of, anything
// else. What comes from file names has to pass here on its way to them.
bool IsUtf8(std::string_view text);

// `text` with every byte that is no part of a UTF-8 character written as %XX.
std::string ToUtf8(std::string_view text);

}  // namespace meshwright
