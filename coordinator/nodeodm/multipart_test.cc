// SPDX-License-Identifier: Apache-2.0
#include "coordinator/nodeodm/multipart.h"

#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr char kType[] = "multipart/form-data; boundary=xYz";

absl::Span<const uint8_t> Bytes(const std::string& text) {
  return absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(text.data()), text.size());
}

// "name=content" or "name:file=content" for each part that ended; "!" and the error at the end.
std::vector<std::string> Read(const std::string& body, size_t piece, const std::string& content_type = kType) {
  std::vector<std::string> parts;
  std::string current;
  MultipartReader reader(content_type, {.begin =
                                            [&](const FormPart& part) {
                                              current =
                                                  absl::StrCat(part.name, part.is_file ? ":" : "", part.file_name, "=");
                                              return absl::OkStatus();
                                            },
                                        .append =
                                            [&](absl::Span<const uint8_t> bytes) {
                                              current.append(bytes.begin(), bytes.end());
                                              return absl::OkStatus();
                                            },
                                        .end =
                                            [&] {
                                              parts.push_back(current);
                                              return absl::OkStatus();
                                            }});
  absl::Status status;
  for (size_t at = 0; at < body.size() && status.ok(); at += piece)
    status = reader.Append(Bytes(body.substr(at, piece)));
  if (status.ok()) status = reader.Finish();
  if (!status.ok()) parts.push_back(absl::StrCat("!", std::string(status.message())));
  return parts;
}

std::string Part(const std::string& disposition, const std::string& content) {
  return absl::StrCat("--xYz\r\nContent-Disposition: form-data; ", disposition, "\r\nContent-Type: image/jpeg\r\n\r\n",
                      content, "\r\n");
}

TEST(MultipartReaderTest, PartsDoNotDependOnThePieces) {
  const std::string photograph("\xff\xd8\r\n--xY\0\r\n--xyz\r\n\r\n-", 22);
  const std::string body = "before\r\n" + Part("name=\"name\"", "a task") +
                           Part("name=images; filename=a.jpg", photograph) +
                           Part("name=\"images\"; filename=\"b;c.jpg\"", "") + "--xYz--\r\nbehind";
  const std::vector<std::string> expected = {"name=a task", "images:a.jpg=" + photograph, "images:b;c.jpg="};
  for (size_t piece = 1; piece < body.size() + 1; ++piece) EXPECT_EQ(Read(body, piece), expected) << piece;
}

TEST(MultipartReaderTest, NamesAreAsClientsWriteThem) {
  const auto name = [](const std::string& disposition) {
    return Read(Part("name=\"images\"; " + disposition, "x") + "--xYz--", 7).front();
  };
  EXPECT_EQ(name(R"(filename="say \"x\".jpg")"), R"(images:say "x".jpg=x)");
  EXPECT_EQ(name(R"(filename="C:\photos\a.jpg")"), R"(images:C:\photos\a.jpg=x)");
  EXPECT_EQ(name("filename*=utf-8''na%C3%AFve%20.jpg"), "images:na\xC3\xAFve .jpg=x");
  EXPECT_EQ(name("filename=\"plain.jpg\"; filename*=UTF-8''b%zz.jpg"), "images:b%zz.jpg=x");
  EXPECT_EQ(name("FILENAME=\"\""), "images:=x");
  EXPECT_THAT(Read("--\"q\"\r\nContent-Disposition: form-data; name=a\r\n\r\n1\r\n--\"q\"--", 5,
                   "multipart/form-data; charset=utf-8; boundary=\"q\""),
              ElementsAre(HasSubstr("breaks off")));
  EXPECT_THAT(Read("--q r\r\nContent-Disposition: form-data; name=a\r\n\r\n1\r\n--q r--", 5,
                   "Multipart/Form-Data; Boundary=\"q r\""),
              ElementsAre("a=1"));
}

TEST(MultipartReaderTest, WhatBreaksOffEndsNoPart) {
  const std::string body = Part("name=\"a\"", "1") + Part("name=\"images\"; filename=\"b\"", "22") + "--xYz--";
  const size_t second = body.find("22");
  for (size_t length = 0; length < body.size(); ++length) {
    const std::vector<std::string> parts = Read(body.substr(0, length), 3);
    EXPECT_THAT(parts.back(), HasSubstr("breaks off")) << length;
    EXPECT_LE(parts.size(), length < second + 4 + 5 ? 2U : 3U) << length;
  }
}

TEST(MultipartReaderTest, RefusesWhatIsNoForm) {
  EXPECT_TRUE(MultipartReader::Check(kType).ok());
  for (const char* type : {"", "application/json", "multipart/form-data", "multipart/mixed; boundary=a",
                           "multipart/form-data; boundary="}) {
    EXPECT_FALSE(MultipartReader::Check(type).ok()) << type;
  }
  EXPECT_THAT(Read("--xYz\r\n\r\n1\r\n--xYz--", 4).back(), HasSubstr("no Content-Disposition"));
  EXPECT_THAT(Read("--xYz\r\nContent-Disposition: form-data\r\n\r\n1\r\n--xYz--", 4).back(), HasSubstr("no Content-"));
  EXPECT_THAT(Read("--xYzw\r\n", 4).back(), HasSubstr("behind a boundary"));
  EXPECT_THAT(Read("--xYz\r\nX: " + std::string(9000, 'y'), 4).back(), HasSubstr("head of more than"));
}

}  // namespace
}  // namespace meshwright
