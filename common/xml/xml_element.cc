// SPDX-License-Identifier: Apache-2.0
#include "common/xml/xml_element.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <utility>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <expat.h>

namespace meshwright {
namespace {

constexpr size_t kMostLevels = 64;
constexpr size_t kLongestText = size_t{64} << 10;

// What expat calls while it reads.
class Builder {
 public:
  explicit Builder(XML_Parser parser) : parser_(parser) {}

  static void Begin(void* self, const XML_Char* name, const XML_Char** attributes) {
    static_cast<Builder*>(self)->Begin(name, attributes);
  }
  static void End(void* self, const XML_Char* /*name*/) { static_cast<Builder*>(self)->End(); }
  static void Text(void* self, const XML_Char* text, int length) {
    static_cast<Builder*>(self)->Text(text, static_cast<size_t>(length));
  }
  static void DocumentType(void* self, const XML_Char*, const XML_Char*, const XML_Char*, int) {
    static_cast<Builder*>(self)->Stop("a document type, expected none");
  }

  const std::string& fault() const { return fault_; }
  XmlElement TakeRoot() { return std::move(root_); }

 private:
  void Stop(const char* fault) {
    if (!fault_.empty()) return;
    fault_ = fault;
    XML_StopParser(parser_, XML_FALSE);
  }

  void Begin(const XML_Char* name, const XML_Char** attributes) {
    if (open_.size() == kMostLevels) return Stop("elements are nested deeper than 64");
    XmlElement element{.name = name, .line = static_cast<int64_t>(XML_GetCurrentLineNumber(parser_))};
    for (const XML_Char** next = attributes; *next != nullptr; next += 2) element.attributes[next[0]] = next[1];
    open_.push_back(std::move(element));
  }

  void End() {
    XmlElement element = std::move(open_.back());
    open_.pop_back();
    if (open_.empty()) {
      root_ = std::move(element);
    } else {
      open_.back().children.push_back(std::move(element));
    }
  }

  void Text(const XML_Char* text, size_t length) {
    std::string& all = open_.back().text;
    if (all.size() + length > kLongestText) return Stop("a text is longer than 65536 bytes");
    all.append(text, length);
  }

  XML_Parser parser_;
  std::vector<XmlElement> open_;  // the path to where it reads
  XmlElement root_;
  std::string fault_;
};

}  // namespace

const XmlElement* XmlElement::Find(std::string_view child) const {
  const auto found =
      std::find_if(children.begin(), children.end(), [&](const XmlElement& c) { return c.name == child; });
  return found == children.end() ? nullptr : &*found;
}

const std::string* XmlElement::Attribute(const std::string& attribute) const {
  const auto found = attributes.find(attribute);
  return found == attributes.end() ? nullptr : &found->second;
}

absl::StatusOr<XmlElement> ParseXml(const std::string& text) {
  if (text.size() > static_cast<size_t>(std::numeric_limits<int>::max())) {
    return absl::InvalidArgumentError(absl::StrCat(text.size(), " bytes, expected at most 2 GiB"));
  }
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser(XML_ParserCreate(nullptr), &XML_ParserFree);
  Builder builder(parser.get());
  XML_SetUserData(parser.get(), &builder);
  XML_SetElementHandler(parser.get(), &Builder::Begin, &Builder::End);
  XML_SetCharacterDataHandler(parser.get(), &Builder::Text);
  XML_SetStartDoctypeDeclHandler(parser.get(), &Builder::DocumentType);
  const auto length = static_cast<int>(text.size());
  if (XML_Parse(parser.get(), text.data(), length, XML_TRUE) == XML_STATUS_OK) return builder.TakeRoot();
  const std::string fault =
      builder.fault().empty() ? std::string(XML_ErrorString(XML_GetErrorCode(parser.get()))) : builder.fault();
  return absl::InvalidArgumentError(absl::StrCat("line ", XML_GetCurrentLineNumber(parser.get()), ": ", fault));
}

}  // namespace meshwright
