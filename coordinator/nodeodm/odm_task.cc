// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/odm_task.h"

#include <cstdint>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <openssl/rand.h>

#include "common/base/check.h"
#include "common/json/parse_json.h"
#include "common/json/whole_number.h"

namespace meshwright {
namespace {

constexpr size_t kMaxTaskBytes = size_t{4} << 20;
constexpr int kMaxDepth = 20;

std::string Dump(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace

bool IsUuid(const std::string& text) {
  if (text.size() != 36) return false;
  for (size_t i = 0; i < text.size(); ++i) {
    const bool is_dash = i == 8 || i == 13 || i == 18 || i == 23;
    const bool is_hex = (text[i] >= '0' && text[i] <= '9') || (text[i] >= 'a' && text[i] <= 'f');
    if (is_dash ? text[i] != '-' : !is_hex) return false;
  }
  return true;
}

// Where nobody shows a key, whoever knows one may do with the task what he likes, so that it has to be hard to guess.
std::string DrawUuid() {
  unsigned char bytes[16];
  MW_CHECK(RAND_bytes(bytes, sizeof(bytes)) == 1);
  bytes[6] = static_cast<unsigned char>((bytes[6] & 0x0F) | 0x40);  // RFC 9562: version 4
  bytes[8] = static_cast<unsigned char>((bytes[8] & 0x3F) | 0x80);
  std::string text;
  for (size_t i = 0; i < sizeof(bytes); ++i) {
    if (i == 4 || i == 6 || i == 8 || i == 10) text.push_back('-');
    absl::StrAppendFormat(&text, "%02x", bytes[i]);
  }
  return text;
}

absl::Status NoSuchTask() { return absl::NotFoundError("Invalid uuid (not found)"); }

std::string ReconstructionOf(const OdmTask& task) {
  return task.run == 0 ? task.uuid : absl::StrCat(task.uuid, "-", task.run);
}

bool HasEnded(const OdmTask& task) {
  return task.status == OdmStatus::kFailed || task.status == OdmStatus::kCompleted ||
         task.status == OdmStatus::kCancelled;
}

std::string EncodeTask(const OdmTask& task) {
  return Dump({{"uuid", task.uuid},
               {"run", task.run},
               {"name", task.name},
               {"owner", task.owner},
               {"options", task.options},
               {"outputs", task.outputs},
               {"webhook", task.webhook},
               {"committed", task.is_committed},
               {"created_ms", task.created_ms},
               {"begun_ms", task.begun_ms},
               {"ended_ms", task.ended_ms},
               {"status", static_cast<int>(task.status)},
               {"error", task.error},
               {"progress", task.progress},
               {"images", task.images},
               {"longest_side_px", task.longest_side_px},
               {"parts_told", task.parts_told},
               {"has_result", task.has_result}});
}

absl::StatusOr<OdmTask> DecodeTask(const std::string& text) {
  const auto json = ParseJson<nlohmann::ordered_json>(text, {.max_bytes = kMaxTaskBytes, .max_depth = kMaxDepth});
  if (!json.ok()) return absl::DataLossError(absl::StrCat("a task ", std::string(json.status().message())));
  bool are_whole = true;
  const auto whole = [&]<typename T>(const char* key, T& to) {
    const absl::StatusOr<T> number = WholeNumber<T>(json->at(key));
    are_whole = are_whole && number.ok();
    to = number.value_or(0);
  };
  try {
    OdmTask task = {.uuid = json->at("uuid"),
                    .name = json->at("name"),
                    .owner = json->value("owner", ""),  // earlier programs knew none
                    .options = json->at("options"),
                    .outputs = json->at("outputs"),
                    .webhook = json->at("webhook"),
                    .is_committed = json->at("committed"),
                    .error = json->at("error"),
                    .progress = json->at("progress"),
                    .has_result = json->at("has_result")};
    int status = 0;
    whole("run", task.run);
    whole("created_ms", task.created_ms);
    whole("begun_ms", task.begun_ms);
    whole("ended_ms", task.ended_ms);
    whole("status", status);
    whole("images", task.images);
    whole("longest_side_px", task.longest_side_px);
    whole("parts_told", task.parts_told);
    task.status = static_cast<OdmStatus>(status);
    if (are_whole && IsUuid(task.uuid)) return task;
  } catch (const nlohmann::json::exception&) {
    // Said below.
  }
  return absl::DataLossError("a task's file is damaged");
}

nlohmann::ordered_json DescribeTask(const OdmTask& task, int64_t now_ms) {
  nlohmann::ordered_json status = {{"code", static_cast<int>(task.status)}};
  if (!task.error.empty()) status["errorMessage"] = task.error;
  const int64_t until = task.ended_ms > 0 ? task.ended_ms : now_ms;
  return {{"uuid", task.uuid},
          {"name", task.name},
          {"dateCreated", task.created_ms},
          {"processingTime", task.begun_ms > 0 ? until - task.begun_ms : -1},
          {"status", status},
          {"options", task.options},
          {"imagesCount", task.images},
          {"progress", task.progress}};
}

}  // namespace meshwright
