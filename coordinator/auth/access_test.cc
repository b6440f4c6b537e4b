// SPDX-License-Identifier: Apache-2.0
#include "coordinator/auth/access.h"

#include <gtest/gtest.h>

#include "coordinator/auth/request_rate.h"
#include "coordinator/auth/token_text.h"

namespace meshwright {
namespace {

TEST(AccessTest, RolesMayWhatTheTableSays) {
  constexpr Action kAll[] = {Action::kList,  Action::kRead,    Action::kCreate,  Action::kChange,
                             Action::kShare, Action::kInspect, Action::kOperate, Action::kWork};
  const struct {
    Role role;
    const char* may;  // a letter for each action
  } table[] = {{Role::kViewer, "yynnnnnn"},
               {Role::kSubmitter, "yyyyynnn"},
               {Role::kOperator, "yyyyyyyn"},
               {Role::kWorker, "nnnnnnny"}};
  for (const auto& row : table) {
    for (size_t i = 0; i < std::size(kAll); ++i) {
      const absl::Status allowed = CheckRole({.user = "alice", .role = row.role}, kAll[i]);
      EXPECT_EQ(allowed.ok(), row.may[i] == 'y') << NameOf(row.role) << " " << i;
      EXPECT_TRUE(allowed.ok() || absl::IsPermissionDenied(allowed)) << allowed;
      // Whatever the role, a share link only reads.
      EXPECT_EQ(CheckRole({.role = row.role, .only = "castle"}, kAll[i]).ok(), kAll[i] == Action::kRead);
    }
    EXPECT_EQ(RoleNamed(NameOf(row.role)), row.role);
  }
  EXPECT_EQ(RoleNamed("king"), std::nullopt);
}

TEST(AccessTest, UsersSeeTheirOwnAndOperatorsAll) {
  const Caller alice = {.user = "alice", .role = Role::kSubmitter};
  EXPECT_TRUE(MaySee(alice, "castle", "alice"));
  EXPECT_FALSE(MaySee(alice, "castle", "bob"));
  EXPECT_FALSE(MaySee(alice, "castle", ""));
  EXPECT_FALSE(MaySee({.user = "", .role = Role::kViewer}, "castle", ""));
  EXPECT_TRUE(MaySee({.user = "root", .role = Role::kOperator}, "castle", ""));
  const Caller link = {.user = "alice", .role = Role::kViewer, .only = "castle"};
  EXPECT_TRUE(MaySee(link, "castle", "bob"));
  EXPECT_FALSE(MaySee(link, "tower", "alice"));
}

TEST(TokenTextTest, IsReadBackAndNothingElseIs) {
  const TokenText token = NewToken();
  const auto read = ParseToken(token.Text());
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->id, token.id);
  EXPECT_EQ(read->secret, token.secret);
  EXPECT_NE(NewToken().secret, token.secret);
  const std::string text = token.Text();
  for (const std::string& bad :
       {std::string(), text + "0", text.substr(1), "MWT_" + text.substr(4), text.substr(0, 20) + "-" + text.substr(21),
        text.substr(0, text.size() - 1) + "G", std::string(text.size(), '\0')}) {
    EXPECT_FALSE(ParseToken(bad).has_value()) << bad;
  }
}

TEST(RequestRateTest, ABurstThenTheRate) {
  RequestRate rate(5);
  absl::Time now = absl::FromUnixSeconds(1000);
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(rate.Take("alice", now));
  EXPECT_FALSE(rate.Take("alice", now));
  EXPECT_TRUE(rate.Take("bob", now));
  now += absl::Milliseconds(201);
  EXPECT_TRUE(rate.Take("alice", now));
  EXPECT_FALSE(rate.Take("alice", now));
  // A clock that goes back takes nothing away for good.
  EXPECT_FALSE(rate.Take("alice", now - absl::Hours(1)));
  EXPECT_TRUE(rate.Take("alice", now - absl::Hours(1) + absl::Seconds(1)));
}

}  // namespace
}  // namespace meshwright
