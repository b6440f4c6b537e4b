// SPDX-License-Identifier: Apache-2.0
#include "common/base/digest.h"

#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(Sha256, KnownAnswers) {
  EXPECT_EQ(Sha256Hex(std::string()), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(Sha256Hex(std::string("abc")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(Sha256, PiecesGiveTheDigestOfTheWhole) {
  const std::string text(100'000, 'x');
  Sha256Stream stream;
  for (size_t i = 0; i < text.size(); i += 777) {
    const std::string piece = text.substr(i, 777);
    stream.Update(absl::MakeConstSpan(reinterpret_cast<const uint8_t*>(piece.data()), piece.size()));
  }
  EXPECT_EQ(stream.HexDigest(), Sha256Hex(text));
}

}  // namespace
}  // namespace meshwright
