// SPDX-License-Identifier: Apache-2.0
#include "common/base/host_port.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace meshwright {
namespace {

TEST(HostPortTest, HostAndPort) {
  const auto name = ParseHostPort("some-host.example:7420", "--listen");
  ASSERT_TRUE(name.ok()) << name.status();
  EXPECT_EQ(name->host, "some-host.example");
  EXPECT_EQ(name->port, 7420);
  EXPECT_EQ(ParseHostPort("[::1]:0", "--listen")->host, "::1");
  EXPECT_EQ(ParseHostPort("127.0.0.2:65535", "--listen")->port, 65535);
}

TEST(HostPortTest, TextGoesRound) {
  for (const char* text : {"host.example:0", "0.0.0.0:7420", "[::1]:1", "[2001:db8::7]:65535"}) {
    EXPECT_EQ(ToString(*ParseHostPort(text, "--listen")), text);
  }
}

TEST(HostPortTest, WhatIsNoneIsNamed) {
  for (const char* text : {"", ":", "host", "7420", ":7420", "host:", "host:x", "host:65536", "host:-1", "host:+1",
                           "host: 1", "::1:7420", "[host]:1", "[]:1", "a host:1", "host:99999999999999"}) {
    const auto address = ParseHostPort(text, "--listen");
    EXPECT_TRUE(absl::IsInvalidArgument(address.status())) << text;
    EXPECT_EQ(std::string(address.status().message()), "--listen is \"" + std::string(text) + "\", expected host:port");
  }
}

}  // namespace
}  // namespace meshwright
