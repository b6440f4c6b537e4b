// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/json_node.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include <absl/strings/str_cat.h>

#include "common/base/status_macros.h"
#include "common/json/json_text.h"
#include "common/json/parse_json.h"

namespace meshwright {
namespace {

using nlohmann::json;

constexpr JsonLimits kLimits = {.max_bytes = size_t{1} << 30, .max_depth = 64};
constexpr size_t kLongestText = size_t{64} << 10;

// NaN where it is no number.
double NumberIn(const json& value) {
  if (value.is_number()) return value.get<double>();
  double number = std::numeric_limits<double>::quiet_NaN();
  if (!value.is_string()) return number;
  const auto& text = value.get_ref<const std::string&>();
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole ? number : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

absl::StatusOr<JsonNode> JsonNode::ReadFile(const std::string& path) {
  MW_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(path));
  absl::StatusOr<json> parsed = ParseJson(text, kLimits);
  if (!parsed.ok()) return absl::InvalidArgumentError(absl::StrCat(path, ": ", std::string(parsed.status().message())));
  const auto file = std::make_shared<const File>(File{.path = path, .json = *std::move(parsed)});
  return JsonNode(file, &file->json, "");
}

Place JsonNode::place() const { return {.file = path_.empty() ? file_->path : absl::StrCat(file_->path, ", ", path_)}; }

absl::Status JsonNode::Error(const std::string& expected) const {
  // What is long is not worth making text of.
  const std::string value = value_->is_structured() ? absl::StrCat("an ", value_->type_name(), " of ", value_->size())
                            : value_->is_string()   ? Quoted(value_->get_ref<const std::string&>())
                                                    : JsonText(*value_);
  return FieldError({.file = file_->path}, path_.empty() ? "all of it" : path_, value, expected);
}

absl::StatusOr<JsonNode> JsonNode::At(const std::string& name) const {
  if (!IsObject()) return Error(absl::StrCat("an object with \"", name, "\""));
  const std::string path = path_.empty() ? name : absl::StrCat(path_, ".", name);
  const auto found = value_->find(name);
  if (found == value_->end()) return FieldError({.file = file_->path}, path, "missing", "a value");
  return JsonNode(file_, &*found, path);
}

absl::StatusOr<std::vector<JsonNode>> JsonNode::Elements() const {
  if (!IsArray()) return Error("an array");
  std::vector<JsonNode> elements;
  elements.reserve(value_->size());
  for (size_t i = 0; i < value_->size(); ++i) {
    elements.push_back(JsonNode(file_, &(*value_)[i], absl::StrCat(path_, "[", i, "]")));
  }
  return elements;
}

absl::StatusOr<std::vector<std::pair<std::string, JsonNode>>> JsonNode::Members() const {
  if (!IsObject()) return Error("an object");
  std::vector<std::pair<std::string, JsonNode>> members;
  for (const auto& [name, value] : value_->items()) {
    members.emplace_back(name, JsonNode(file_, &value, absl::StrCat(path_, path_.empty() ? "" : ".", Quoted(name))));
  }
  return members;
}

absl::StatusOr<double> JsonNode::Number() const {
  const double number = NumberIn(*value_);
  if (!std::isfinite(number)) return Error("a finite number");
  return number;
}

absl::StatusOr<int64_t> JsonNode::Integer(int64_t smallest, int64_t largest) const {
  const double number = NumberIn(*value_);
  if (!(number >= static_cast<double>(smallest) && number <= static_cast<double>(largest)) ||
      number != std::floor(number)) {
    return Error(absl::StrCat("an integer from ", smallest, " to ", largest));
  }
  return static_cast<int64_t>(number);
}

absl::StatusOr<std::string> JsonNode::Text() const {
  if (value_->is_number()) return JsonText(*value_);
  if (!value_->is_string() || value_->get_ref<const std::string&>().size() > kLongestText) return Error("a text");
  return value_->get<std::string>();
}

absl::Status JsonNode::AppendNumbers(const json& value, size_t most, std::vector<double>* numbers) const {
  if (value.is_array()) {
    for (const json& element : value) MW_RETURN_IF_ERROR(AppendNumbers(element, most, numbers));
    return absl::OkStatus();
  }
  const double number = NumberIn(value);
  if (!std::isfinite(number) || numbers->size() == most) return Error(absl::StrCat(most, " finite numbers"));
  numbers->push_back(number);
  return absl::OkStatus();
}

absl::StatusOr<std::vector<double>> JsonNode::Numbers(size_t count) const {
  std::vector<double> numbers;
  if (!value_->is_array()) return Error(absl::StrCat(count, " finite numbers"));
  MW_RETURN_IF_ERROR(AppendNumbers(*value_, count, &numbers));
  if (numbers.size() != count) return Error(absl::StrCat(count, " finite numbers"));
  return numbers;
}

absl::StatusOr<Eigen::Vector3d> JsonNode::Vector3() const {
  MW_ASSIGN_OR_RETURN(const std::vector<double> numbers, Numbers(3));
  return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
}

absl::StatusOr<std::array<uint8_t, 3>> JsonNode::Color() const {
  MW_ASSIGN_OR_RETURN(const Eigen::Vector3d numbers, Vector3());
  std::array<uint8_t, 3> color{};
  for (size_t k = 0; k < 3; ++k) {
    color[k] = static_cast<uint8_t>(std::clamp(numbers[static_cast<Eigen::Index>(k)], 0.0, 255.0));
  }
  return color;
}

absl::StatusOr<Eigen::Matrix3d> JsonNode::Matrix3() const {
  MW_ASSIGN_OR_RETURN(const std::vector<double> numbers, Numbers(9));
  return Eigen::Matrix3d(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data()));
}

absl::StatusOr<double> JsonNode::Number(const std::string& name) const {
  MW_ASSIGN_OR_RETURN(const JsonNode node, At(name));
  return node.Number();
}

absl::StatusOr<double> JsonNode::NumberOr(const std::string& name, double otherwise) const {
  if (!Has(name)) return otherwise;
  return Number(name);
}

absl::StatusOr<int64_t> JsonNode::Integer(const std::string& name, int64_t smallest, int64_t largest) const {
  MW_ASSIGN_OR_RETURN(const JsonNode node, At(name));
  return node.Integer(smallest, largest);
}

absl::StatusOr<std::string> JsonNode::Text(const std::string& name) const {
  MW_ASSIGN_OR_RETURN(const JsonNode node, At(name));
  return node.Text();
}

absl::StatusOr<std::vector<JsonNode>> JsonNode::Elements(const std::string& name) const {
  MW_ASSIGN_OR_RETURN(const JsonNode node, At(name));
  return node.Elements();
}

absl::StatusOr<int> JsonNode::Side(const std::string& name) const {
  constexpr int64_t kLargestSide = 1'000'000;  // px; CheckLens holds the product
  MW_ASSIGN_OR_RETURN(const int64_t side, Integer(name, 1, kLargestSide));
  return static_cast<int>(side);
}

}  // namespace meshwright
