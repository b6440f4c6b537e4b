// SPDX-License-Identifier: Apache-2.0
// Holds the OpenAPI file against the routes, both ways: paths, methods and query parameters; and against the messages.

#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "coordinator/rest/routes.h"

namespace meshwright {

const std::vector<std::pair<std::string, std::string>>& RestDescriptions();

namespace {

using Operations = std::map<std::string, std::set<std::string>>;  // "GET /path" -> names of query parameters

std::string UpperCase(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

// By the file's own layout: paths are indented by two blanks, methods by four, parameters by eight.
Operations OperationsInFile() {
  static const std::regex path_line("  (/[^ ]*):");
  static const std::regex method_line("    (get|head|put|post|patch|delete|options|trace):");
  static const std::regex name_line("        - name: (.*)");
  Operations operations;
  std::istringstream lines(RestDescriptions().front().second);
  std::string line, path, operation, name;
  for (std::smatch match; std::getline(lines, line);) {
    if (std::regex_match(line, match, path_line)) {
      path = match[1];
      operation.clear();
    } else if (std::regex_match(line, match, method_line)) {
      operation = UpperCase(match[1]) + " " + path;
      operations[operation];
    } else if (std::regex_match(line, match, name_line)) {
      name = match[1];
    } else if (line == "          in: query") {
      operations[operation].insert(name);
    }
  }
  return operations;
}

// Schemas of objects -> names of their properties, which are indented by eight blanks.
Operations SchemasInFile() {
  static const std::regex schema_line("    ([A-Z][A-Za-z0-9]*):");
  static const std::regex property_line("        ([a-z][A-Za-z0-9]*):.*");
  Operations schemas;
  std::istringstream lines(RestDescriptions().front().second);
  std::string line, schema;
  bool is_schema = false;
  bool is_property = false;
  for (std::smatch match; std::getline(lines, line);) {
    if (line == "  schemas:") is_schema = true;
    if (!is_schema) continue;
    if (std::regex_match(line, match, schema_line)) {
      schema = match[1];
      is_property = false;
    } else if (line.rfind("      ", 0) == 0 && line[6] != ' ') {
      is_property = line == "      properties:";
    } else if (is_property && std::regex_match(line, match, property_line)) {
      schemas[schema].insert(match[1]);
    }
  }
  return schemas;
}

TEST(OpenApiTest, SaysWhatTheMessagesHave) {
  const Operations schemas = SchemasInFile();
  const auto expect = [&](const google::protobuf::Descriptor* message, const std::set<std::string>& added = {}) {
    std::set<std::string> names = added;
    for (int i = 0; i < message->field_count(); ++i) names.insert(message->field(i)->json_name());
    const auto found = schemas.find(message->name());
    ASSERT_TRUE(found != schemas.end()) << message->name();
    EXPECT_EQ(found->second, names) << message->name();
  };
  expect(v1::Reconstruction::descriptor());
  expect(v1::Progress::descriptor());
  expect(v1::CreateReconstructionRequest::descriptor());
  expect(v1::ListReconstructionsResponse::descriptor());
  expect(v1::Camera::descriptor(), {"attempts", "geometry", "seconds", "shares"});
  expect(v1::ListCamerasResponse::descriptor());
  expect(v1::GetIncidenceResponse::descriptor());
  expect(v1::Part::descriptor());
  expect(v1::ListPartsResponse::descriptor());
  expect(v1::Attempt::descriptor());
  expect(v1::ListAttemptsResponse::descriptor());
  expect(v1::Worker::descriptor());
  expect(v1::ListWorkersResponse::descriptor());
}

TEST(OpenApiTest, SaysWhatTheRoutesAreAndNothingElse) {
  const RestContext context;
  Operations routes;
  for (const Route& route : MakeRoutes(context)) {
    const std::string operation = route.method + " " + route.path;
    EXPECT_EQ(routes.count(operation), 0U) << operation << " is there twice";
    routes[operation] = {route.query.begin(), route.query.end()};
  }
  Operations described = OperationsInFile();
  // GET routes answer HEAD too; the file only says so where it matters.
  for (auto it = described.begin(); it != described.end();) {
    const bool head = it->first.rfind("HEAD ", 0) == 0;
    if (head) {
      EXPECT_EQ(routes.count("GET " + it->first.substr(5)), 1U) << it->first;
    }
    it = head ? described.erase(it) : std::next(it);
  }
  EXPECT_GT(routes.size(), 20U);
  EXPECT_EQ(described, routes);
}

// A path must not be caught by a route that stands before its own.
TEST(OpenApiTest, EachRouteIsReached) {
  const RestContext context;
  const Router router(MakeRoutes(context));
  for (const Route& route : router.routes()) {
    HttpRequest request;
    HttpResponse response;
    request.method = route.method;
    request.path = std::regex_replace(route.path, std::regex("\\{[a-z]*\\}"), "7");
    RestCall call = {.request = request, .response = response};
    const auto found = router.Match(call);
    ASSERT_TRUE(found.ok()) << route.path;
    EXPECT_EQ((*found)->path, route.path);
  }
}

}  // namespace
}  // namespace meshwright
