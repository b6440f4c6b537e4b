// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "common/scene/formats/text_fields.h"

namespace meshwright {

// A value in a JSON file of a scene, which knows where it stands: errors name the file, the field
// ("frames[3].transform_matrix"), its value and what was expected.
class JsonNode {
 public:
  // Reads a whole file; files of scenes are large and hardly nested. InvalidArgument: no JSON, nested too deep.
  static absl::StatusOr<JsonNode> ReadFile(const std::string& path);

  bool IsObject() const { return value_->is_object(); }
  bool IsArray() const { return value_->is_array(); }
  bool Has(const std::string& name) const {
    return IsObject() && value_->contains(name) && !value_->at(name).is_null();
  }
  bool IsTrue() const { return value_->is_boolean() && value_->get<bool>(); }
  size_t size() const { return value_->size(); }
  const std::string& path() const { return path_; }
  Place place() const;

  // A member of an object.
  absl::StatusOr<JsonNode> At(const std::string& name) const;
  // All elements of an array, in their order.
  absl::StatusOr<std::vector<JsonNode>> Elements() const;
  // All members of an object, by their names.
  absl::StatusOr<std::vector<std::pair<std::string, JsonNode>>> Members() const;

  // The value itself. A finite number; some programs write numbers as strings.
  absl::StatusOr<double> Number() const;
  absl::StatusOr<int64_t> Integer(int64_t smallest, int64_t largest) const;
  // A string, or a number as it is written: ids are either.
  absl::StatusOr<std::string> Text() const;
  // `count` numbers in arrays however nested, in their order.
  absl::StatusOr<std::vector<double>> Numbers(size_t count) const;
  absl::StatusOr<Eigen::Vector3d> Vector3() const;
  // Three numbers from 0 to 255.
  absl::StatusOr<std::array<uint8_t, 3>> Color() const;
  // Nine numbers, row by row.
  absl::StatusOr<Eigen::Matrix3d> Matrix3() const;

  // The same of a member.
  absl::StatusOr<double> Number(const std::string& name) const;
  absl::StatusOr<double> NumberOr(const std::string& name, double otherwise) const;
  absl::StatusOr<int64_t> Integer(const std::string& name, int64_t smallest, int64_t largest) const;
  absl::StatusOr<std::string> Text(const std::string& name) const;
  absl::StatusOr<std::vector<JsonNode>> Elements(const std::string& name) const;

  // InvalidArgument: "<file>: <field> is <value>; expected <expected>".
  absl::Status Error(const std::string& expected) const;
  // The value of `name` as pixels of a picture's side.
  absl::StatusOr<int> Side(const std::string& name) const;

 private:
  struct File {
    std::string path;
    nlohmann::json json;
  };
  JsonNode(std::shared_ptr<const File> file, const nlohmann::json* value, std::string path)
      : file_(std::move(file)), value_(value), path_(std::move(path)) {}
  absl::Status AppendNumbers(const nlohmann::json& value, size_t most, std::vector<double>* numbers) const;

  std::shared_ptr<const File> file_;
  const nlohmann::json* value_;
  std::string path_;  // "" for the whole
};

}  // namespace meshwright
