// SPDX-License-Identifier: Apache-2.0
#include "common/xml/xml_element.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using testing::HasSubstr;

std::string Refusal(const std::string& text) {
  const auto root = ParseXml(text);
  EXPECT_TRUE(absl::IsInvalidArgument(root.status())) << text.substr(0, 60);
  return std::string(root.status().message());
}

std::string Nested(int levels) {
  std::string text;
  for (int i = 0; i < levels; ++i) text += "<a>";
  for (int i = 0; i < levels; ++i) text += "</a>";
  return text;
}

TEST(ParseXmlTest, ElementsAttributesTextsAndLines) {
  const auto root =
      ParseXml("<?xml version=\"1.0\"?>\n<!-- <x> -->\n<a k=\"&lt;1\">\n <b>1 2</b><b>3</b><![CDATA[<c>]]></a>\n");
  ASSERT_TRUE(root.ok()) << root.status();
  EXPECT_EQ(root->name, "a");
  EXPECT_EQ(*root->Attribute("k"), "<1");
  EXPECT_EQ(root->Attribute("l"), nullptr);
  EXPECT_EQ(root->line, 3);
  ASSERT_EQ(root->children.size(), 2U);
  EXPECT_EQ(root->Find("b")->text, "1 2");
  EXPECT_EQ(root->Find("b")->line, 4);
  EXPECT_EQ(root->Find("c"), nullptr);
  EXPECT_THAT(root->text, HasSubstr("<c>"));
}

TEST(ParseXmlTest, WhatIsNotWellFormedIsRefusedWithItsLine) {
  for (const char* text : {"", "a", "<a>", "<a></b>", "<a/><b/>", "<a b=1/>", "<a>&x;</a>", "<a>\xFF</a>"})
    Refusal(text);
  EXPECT_THAT(Refusal("<a>\n\n</b>"), HasSubstr("line 3: "));
}

TEST(ParseXmlTest, DepthIsLimitedAndThereAreNoEntities) {
  EXPECT_TRUE(ParseXml(Nested(64)).ok());
  EXPECT_THAT(Refusal(Nested(65)), HasSubstr("nested deeper than 64"));
  EXPECT_THAT(Refusal(Nested(100'000)), HasSubstr("nested deeper than 64"));
  EXPECT_THAT(Refusal("<!DOCTYPE a [<!ENTITY b SYSTEM \"file:///etc/passwd\">]><a>&b;</a>"),
              HasSubstr("document type"));
  EXPECT_THAT(Refusal("<a>" + std::string(70'000, 'x') + "</a>"), HasSubstr("longer than 65536"));
}

}  // namespace
}  // namespace meshwright
