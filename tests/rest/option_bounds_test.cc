// SPDX-License-Identifier: Apache-2.0
// Every option at its bounds and beyond them, as REST and gRPC take it.

#include <string>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>

#include "clients/cpp/service_client.h"
#include "pipeline/options/option_table.h"
#include "pipeline/options/option_testing.h"

#include "tests/rest/rest_cluster.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

class OptionBoundsOverTheNetworkTest : public RestCluster {
 protected:
  void SetUp() override {
    RestCluster::SetUp();
    grpc_ = ServiceClient::Connect(absl::StrCat("127.0.0.1:", coordinator_->port()));
  }

  // What the interfaces answered: REST's problem and gRPC's message, "" where they accepted.
  struct Answer {
    Json rest;
    std::string grpc;
  };
  Answer Create(const std::string& options_json) {
    const std::string id = absl::StrCat("o", ++tried_);
    Answer answer;
    const Json request = {{"id", id + "-rest"}, {"optionsJson", options_json}};
    const auto result = PostJson("/v1/reconstructions", request.dump());
    EXPECT_TRUE(result) << options_json.substr(0, 80);
    if (result && result->status != 200) answer.rest = Json::parse(result->body, nullptr, false);
    v1::CreateReconstructionRequest create;
    create.set_id(id + "-grpc");
    create.set_options_json(options_json);
    const auto created = grpc_->Create(create);
    if (!created.ok()) {
      EXPECT_TRUE(absl::IsInvalidArgument(created.status())) << created.status();
      answer.grpc = std::string(created.status().message());
    }
    return answer;
  }

  void ExpectRefused(const std::string& options_json, const std::string& message) {
    const Answer answer = Create(options_json);
    EXPECT_EQ(answer.rest.value("status", 0), 400) << options_json.substr(0, 80);
    EXPECT_EQ(answer.rest.value("field", ""), "optionsJson");
    EXPECT_THAT(answer.rest.value("detail", ""), HasSubstr(message));
    EXPECT_THAT(answer.grpc, HasSubstr(message));
  }

  std::unique_ptr<ServiceClient> grpc_;
  int tried_ = 0;
};

TEST_F(OptionBoundsOverTheNetworkTest, EveryOption) {
  const Json list = GetJson("/v1/options")["options"];
  ASSERT_EQ(list.size(), OptionTable().size());
  for (size_t i = 0; i < list.size(); ++i) {
    const Option& option = OptionTable()[i];
    EXPECT_EQ(list[i]["name"], option.name);
    for (const char* end : {"minimum", "maximum"}) {
      const auto bound = list[i][end].get<double>();
      const Answer answer = Create(JsonWithValue(option, bound));
      EXPECT_TRUE(answer.rest.is_null()) << option.name << " " << bound << answer.rest;
      EXPECT_EQ(answer.grpc, "") << option.name << " " << bound;
    }
    for (const std::string& text : RefusedTexts(option)) {
      if (!IsJsonNumber(text)) continue;
      ExpectRefused(absl::StrCat("{\"", option.name, "\":", text, "}"),
                    absl::StrCat(option.name, " is ", text.substr(0, 40), ", expected a ",
                                 option.is_integer() ? "whole number" : "number", " from ", DescribeRange(option)));
    }
  }
}

TEST_F(OptionBoundsOverTheNetworkTest, NestedAndLongTexts) {
  const std::string deep(30'000, '[');
  ExpectRefused("{\"window\":" + deep + std::string(30'000, ']') + "}", "levels deep, expected at most 8");
  ExpectRefused("{\"window\":" + deep, "levels deep, expected at most 8");
  ExpectRefused(std::string(60'000, '[') + std::string(60'000, ']'), "expected at most 65536");
  ExpectRefused(R"({"windw":1})", "did you mean window?");
  // The body itself.
  const auto result = PostJson("/v1/reconstructions", "{\"id\":" + deep + std::string(30'000, ']') + "}");
  ASSERT_TRUE(result);
  EXPECT_EQ(result->status, 400);
  EXPECT_THAT(result->body, HasSubstr("levels deep"));
  EXPECT_EQ(GetJson("/v1/reconstructions")["reconstructions"].size(), 0U);
}

}  // namespace
}  // namespace meshwright
