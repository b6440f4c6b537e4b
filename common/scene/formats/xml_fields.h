// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "common/scene/formats/text_fields.h"
#include "common/xml/xml_element.h"

namespace meshwright {

// An XML file of a scene: what is read from its elements, with errors that name file, line, field, value and what was
// expected.
class XmlFields {
 public:
  explicit XmlFields(std::string file) : file_(std::move(file)) {}

  absl::StatusOr<XmlElement> ReadRoot() const;
  Place PlaceOf(const XmlElement& element) const { return {.file = file_, .number = element.line}; }

  // A child that there must be.
  absl::StatusOr<const XmlElement*> Child(const XmlElement& element, const char* name) const;
  // The text of a child that there must be, without white space around it.
  absl::StatusOr<std::string> Text(const XmlElement& element, const char* name) const;
  absl::StatusOr<double> Number(const XmlElement& element, const char* name) const;
  absl::StatusOr<double> NumberOr(const XmlElement& element, const char* name, double otherwise) const;
  // The text of the element itself, `count` numbers.
  absl::StatusOr<std::vector<double>> Numbers(const XmlElement& element, size_t count) const;
  // Of a child or an attribute, for sides of pictures, px.
  absl::StatusOr<int> Side(const XmlElement& element, const std::string& text, const char* name) const;
  absl::StatusOr<std::string> Attribute(const XmlElement& element, const char* name) const;

 private:
  std::string file_;
};

// The first *.xml file in a folder that begins with `root`, "<document": its tag is in the first kilobytes. Empty:
// none.
std::string FindXmlWithRoot(const std::string& folder, const std::string& root);

}  // namespace meshwright
