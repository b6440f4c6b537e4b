// SPDX-License-Identifier: Apache-2.0
#include "common/http_server/http_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using testing::Pair;

TEST(HttpMessageTest, DecodesTargets) {
  HttpRequest request;
  ASSERT_TRUE(ParseTarget("/a%20b/%2e%2E/c+d%2Fe%zz%4?x=1+2&y=%26&z&=v&x=3#part", request));
  EXPECT_EQ(request.path, "/a b/../c+d/e%zz%4");
  EXPECT_THAT(request.params, testing::UnorderedElementsAre(Pair("x", "1 2"), Pair("x", "3"), Pair("y", "&"),
                                                            Pair("z", ""), Pair("", "v")));
  EXPECT_EQ(request.Param("y"), "&");
  EXPECT_EQ(request.Param("none"), "");
  ASSERT_TRUE(ParseTarget("http://host:80/p?q=1", request));
  EXPECT_EQ(request.path, "/p");
  EXPECT_EQ(request.Param("q"), "1");
  ASSERT_TRUE(ParseTarget("https://host", request));
  EXPECT_EQ(request.path, "/");
  EXPECT_TRUE(request.params.empty());
  for (const char* target : {"", "*", "host:443", "a/b", "?x", "ftp://host/"}) {
    EXPECT_FALSE(ParseTarget(target, request)) << target;
  }
}

TEST(HttpMessageTest, FindsHeadersWhateverTheirCase) {
  HttpHeaders headers;
  headers.Add("Content-Type", "a");
  headers.Add("content-type", "b");
  EXPECT_EQ(headers.Get("CONTENT-TYPE"), "a");
  EXPECT_EQ(headers.Count("Content-type"), 2U);
  headers.Set("CONTENT-type", "c");
  EXPECT_EQ(headers.Count("Content-type"), 1U);
  EXPECT_EQ(headers.Get("Content-type"), "c");
  EXPECT_FALSE(headers.Has("Content"));
}

}  // namespace
}  // namespace meshwright
