// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

namespace meshwright {

// An element of an XML document.
struct XmlElement {
  std::string name;
  std::map<std::string, std::string> attributes;
  std::string text;  // between its tags, without that of its children
  std::vector<XmlElement> children;
  int64_t line = 0;  // of its first tag, from 1

  // The first child of that name; null when there is none.
  const XmlElement* Find(std::string_view child) const;
  // Null when there is none.
  const std::string* Attribute(const std::string& attribute) const;
};

// The root of a document that comes from outside. InvalidArgument ("line 3: ..."), to be put behind the name of the
// file: what is not well-formed, a document type (so no entities but XML's own), elements deeper than 64, texts longer
// than 64 KiB.
absl::StatusOr<XmlElement> ParseXml(const std::string& text);

}  // namespace meshwright
