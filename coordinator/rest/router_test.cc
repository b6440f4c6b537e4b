// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/router.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "coordinator/rest/problem.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

class RouterTest : public testing::Test {
 protected:
  absl::StatusOr<std::string> Match(const std::string& method, const std::string& path,
                                    const std::multimap<std::string, std::string>& params = {}) {
    request_.method = method;
    request_.path = path;
    request_.params = params;
    response_ = {};
    RestCall call = {.request = request_, .response = response_};
    const auto route = router_.Match(call);
    if (!route.ok()) return route.status();
    values_ = call.path;
    return (*route)->method + " " + (*route)->path;
  }

  const Router router_{{
      {"GET", "/things", {"size", "from"}},
      {"POST", "/things", {}},
      {"POST", "/things/{id}:start", {}},
      {"GET", "/things/{id}", {}},
      {"DELETE", "/things/{id}", {}},
      {"GET", "/things/{id}/files/{path}", {}},
  }};
  HttpRequest request_;
  HttpResponse response_;
  std::map<std::string, std::string> values_;
};

TEST_F(RouterTest, FindsTheRouteAndWhatStandsForNames) {
  EXPECT_EQ(*Match("GET", "/things"), "GET /things");
  EXPECT_EQ(*Match("HEAD", "/things/a7"), "GET /things/{id}");
  EXPECT_EQ(values_.at("id"), "a7");
  EXPECT_EQ(*Match("POST", "/things/a7:start"), "POST /things/{id}:start");
  EXPECT_EQ(values_.at("id"), "a7");
  EXPECT_EQ(*Match("GET", "/things/a7/files/x/../y z"), "GET /things/{id}/files/{path}");
  EXPECT_EQ(values_.at("path"), "x/../y z");
}

TEST_F(RouterTest, TellsWrongPathsFromWrongMethods) {
  for (const char* path : {"/", "/thing", "/things/", "/things/a/", "/things/a/b", "/things/a/files", "things"}) {
    EXPECT_TRUE(absl::IsNotFound(Match("GET", path).status())) << path;
  }
  const absl::Status wrong = Match("PUT", "/things/a7").status();
  EXPECT_EQ(HttpStatusOf(wrong), 405);
  EXPECT_EQ(response_.headers.Get("Allow"), "DELETE, GET, HEAD");
}

TEST_F(RouterTest, RefusesUnknownAndRepeatedParameters) {
  EXPECT_TRUE(Match("GET", "/things", {{"size", "3"}, {"from", "b"}}).ok());
  EXPECT_THAT(std::string(Match("GET", "/things", {{"seize", "3"}}).status().message()), HasSubstr("seize"));
  EXPECT_THAT(std::string(Match("GET", "/things", {{"size", "3"}, {"size", "3"}}).status().message()),
              HasSubstr("twice"));
}

TEST_F(RouterTest, NumbersAreWholeAndInRange) {
  RestCall call = {.request = request_, .response = response_};
  for (const char* text : {"", "-", "x", "1x", " 1", "+1", "1.0", "0x1", "99", "-1", "99999999999999999999"}) {
    request_.params = {{"n", text}};
    const absl::Status status = QueryNumber(call, "n", 0, 9, 5).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << text;
    EXPECT_THAT(ProblemJson(status), HasSubstr(R"("field":"n")"));
  }
  request_.params = {{"n", "7"}};
  EXPECT_EQ(*QueryNumber(call, "n", 0, 9, 5), 7);
  request_.params = {};
  EXPECT_EQ(*QueryNumber(call, "n", 0, 9, 5), 5);
}

TEST(ProblemTest, NamesTheFieldInCamelCase) {
  EXPECT_THAT(ProblemJson(absl::InvalidArgumentError("page_size is -1, expected 0..1000")),
              HasSubstr(R"("field":"pageSize")"));
  EXPECT_THAT(ProblemJson(absl::InvalidArgumentError("options_json: window is 0")),
              HasSubstr(R"("field":"optionsJson")"));
  EXPECT_THAT(ProblemJson(absl::NotFoundError("there is no such thing")), testing::Not(HasSubstr("field")));
  EXPECT_EQ(HttpStatusOf(HttpError(422, absl::InvalidArgumentError("x"))), 422);
}

TEST(ProblemTest, IsTextWhateverCameFromOutside) {
  EXPECT_THAT(ProblemJson(absl::InvalidArgumentError("id is \"\xff\"")), HasSubstr("\xEF\xBF\xBD"));
}

}  // namespace
}  // namespace meshwright
