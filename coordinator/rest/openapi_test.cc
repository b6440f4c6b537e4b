// Holds the OpenAPI file against the routes, both ways: paths, methods and query parameters.

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
    httplib::Request request;
    httplib::Response response;
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
