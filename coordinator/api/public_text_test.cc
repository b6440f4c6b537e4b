// SPDX-License-Identifier: Apache-2.0
#include "coordinator/api/public_text.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(PublicTextTest, TellsNothingOfTheServersFolders) {
  const std::pair<const char*, const char*> texts[] = {
      {"/var/lib/meshwright/blobs/ab/abcd: cannot open", "abcd: cannot open"},
      {"cannot open \"/srv/scenes/secret/images/1.jpg\" (/etc/passwd)", "cannot open \"1.jpg\" (passwd)"},
      {"PUT https://s3.internal:9000/bucket/ab/abcd: HTTP 403", "PUT abcd: HTTP 403"},
      {"images/1.jpg: truncated", "images/1.jpg: truncated"},
      {"x is no parameter of GET /v1/reconstructions/{id}", "x is no parameter of GET /v1/reconstructions/{id}"},
      {"/srv/scenes/: no such folder", ": no such folder"},
      {"/srv/scenes/", "scenes"},
      {"3 / 4", "3 / 4"},
      {"", ""}};
  for (const auto& [text, clean] : texts) EXPECT_EQ(WithoutServerPaths(text), clean);
}

}  // namespace
}  // namespace meshwright
