// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/xml_fields.h"

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/scene/formats/assemble.h"

namespace meshwright {

absl::StatusOr<XmlElement> XmlFields::ReadRoot() const {
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(file_));
  absl::StatusOr<XmlElement> root = ParseXml(text);
  if (!root.ok()) return absl::InvalidArgumentError(absl::StrCat(file_, ", ", std::string(root.status().message())));
  return root;
}

absl::StatusOr<const XmlElement*> XmlFields::Child(const XmlElement& element, const char* name) const {
  const XmlElement* child = element.Find(name);
  if (child != nullptr) return child;
  return FieldError(PlaceOf(element), absl::StrCat(name, " of ", element.name), "missing", "one");
}

absl::StatusOr<std::string> XmlFields::Text(const XmlElement& element, const char* name) const {
  MW_ASSIGN_OR_RETURN(const XmlElement* child, Child(element, name));
  MW_ASSIGN_OR_RETURN(const std::string_view text, TextFields(child->text, PlaceOf(*child)).Rest(name));
  return std::string(text);
}

absl::StatusOr<double> XmlFields::Number(const XmlElement& element, const char* name) const {
  MW_ASSIGN_OR_RETURN(const XmlElement* child, Child(element, name));
  TextFields fields(child->text, PlaceOf(*child));
  MW_ASSIGN_OR_RETURN(const double number, fields.Number(name));
  MW_RETURN_IF_ERROR(fields.ExpectEnd());
  return number;
}

absl::StatusOr<double> XmlFields::NumberOr(const XmlElement& element, const char* name, double otherwise) const {
  return element.Find(name) == nullptr ? absl::StatusOr<double>(otherwise) : Number(element, name);
}

absl::StatusOr<std::vector<double>> XmlFields::Numbers(const XmlElement& element, size_t count) const {
  TextFields fields(element.text, PlaceOf(element));
  std::vector<double> numbers(count);
  for (double& number : numbers) {
    MW_ASSIGN_OR_RETURN(number, fields.Number(element.name.c_str()));
  }
  MW_RETURN_IF_ERROR(fields.ExpectEnd());
  return numbers;
}

absl::StatusOr<int> XmlFields::Side(const XmlElement& element, const std::string& text, const char* name) const {
  constexpr int64_t kLargestSide = 1'000'000;  // px; CheckLens holds the product
  TextFields fields(text, PlaceOf(element));
  MW_ASSIGN_OR_RETURN(const int64_t side, fields.Integer(name, 1, kLargestSide));
  MW_RETURN_IF_ERROR(fields.ExpectEnd());
  return static_cast<int>(side);
}

absl::StatusOr<std::string> XmlFields::Attribute(const XmlElement& element, const char* name) const {
  const std::string* value = element.Attribute(name);
  if (value != nullptr) return *value;
  return FieldError(PlaceOf(element), absl::StrCat("attribute ", name, " of ", element.name), "missing", "one");
}

std::string FindXmlWithRoot(const std::string& folder, const std::string& root) {
  constexpr size_t kHead = 4096;
  for (const std::string& name : FilesEndingIn(folder, ".xml")) {
    std::string file = JoinPath(folder, name);
    if (ReadHead(file, kHead).find(root) != std::string::npos) return file;
  }
  return "";
}

}  // namespace meshwright
