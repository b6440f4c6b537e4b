// SPDX-License-Identifier: Apache-2.0
#include "coordinator/auth/gatekeeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/check.h"
#include "common/base/digest.h"
#include "coordinator/store/sqlite_job_store.h"

namespace meshwright {
namespace {

using testing::HasSubstr;

constexpr char kRootKey[] = "the key of the coordinator";

class GatekeeperTest : public testing::Test {
 protected:
  void SetUp() override {
    store_ = *OpenSqliteJobStore(":memory:", &clock_);
    for (const auto& [id, owner] : {std::pair("castle", "alice"), std::pair("tower", "bob"), std::pair("old", "")}) {
      MW_CHECK(store_
                   ->CreateReconstruction(
                       {.id = id, .options_json = "{}", .state = ReconstructionState::kCreated, .owner = owner},
                       clock_.Now())
                   .ok());
    }
    Open(Sha256Hex(std::string(kRootKey)));
  }
  void Open(const std::string& operator_key_digest) {
    GatekeeperOptions options = {.operator_key_digest = operator_key_digest,
                                 .worker_key_digest = Sha256Hex(std::string("join the workers"))};
    options.quotas = {.reconstructions = 2, .scene_bytes = 100, .requests_per_second = 50};
    options.audit = [this](const AuditEvent& event) { told_.push_back(event); };
    options.count_refusal = [this](const absl::Status&) { ++refusals_; };
    gate_ = std::make_unique<Gatekeeper>(options, *store_, clock_);
  }
  Caller Root() { return *gate_->Identify(kRootKey, "10.0.0.1"); }
  NewKey KeyFor(const std::string& user, Role role, absl::Duration lifetime = absl::InfiniteDuration()) {
    return *gate_->Create(Root(), {.user = user, .role = role, .lifetime = lifetime});
  }
  absl::Status Check(const Caller& caller, Action action, const std::string& id) {
    return gate_->Check(caller, {.action = action, .deed = "test", .reconstruction = id});
  }

  ManualClock clock_;
  std::unique_ptr<JobStore> store_;
  std::vector<AuditEvent> told_;
  int refusals_ = 0;
  std::unique_ptr<Gatekeeper> gate_;
};

TEST_F(GatekeeperTest, WithoutAKeyEverybodyMayDoEverything) {
  Open("");
  const auto caller = gate_->Identify("", "127.0.0.1");
  ASSERT_TRUE(caller.ok());
  for (const Action action : {Action::kRead, Action::kChange, Action::kOperate, Action::kWork}) {
    EXPECT_TRUE(Check(*caller, action, "castle").ok());
  }
}

TEST_F(GatekeeperTest, WrongExpiredAndRevokedKeysAreToldApartByNobody) {
  const NewKey expired = KeyFor("alice", Role::kSubmitter, absl::Seconds(1));
  const NewKey revoked = KeyFor("alice", Role::kSubmitter);
  const NewKey good = KeyFor("alice", Role::kSubmitter);
  ASSERT_TRUE(gate_->Revoke(Root(), revoked.token.id).ok());
  clock_.Advance(absl::Seconds(2));
  std::string wrong = good.text;
  wrong.back() = wrong.back() == '0' ? '1' : '0';
  std::string unknown = good.text;
  unknown[5] = unknown[5] == '0' ? '1' : '0';
  std::string said;
  for (const std::string& key :
       {std::string(), std::string("x"), std::string(kRootKey) + "x", expired.text, revoked.text, wrong, unknown}) {
    const absl::Status status = gate_->Identify(key, "10.0.0.9").status();
    EXPECT_TRUE(absl::IsUnauthenticated(status)) << status;
    if (said.empty()) said = status.ToString();
    EXPECT_EQ(status.ToString(), said);
  }
  EXPECT_EQ(refusals_, 7);
  const auto alice = gate_->Identify(good.text, "10.0.0.9");
  ASSERT_TRUE(alice.ok());
  EXPECT_EQ(alice->user, "alice");
  EXPECT_EQ(store_->GetToken(good.token.id)->digest.find(good.text.substr(21)), std::string::npos);
}

TEST_F(GatekeeperTest, ReconstructionsOfOthersAreAsIfTheyWereNot) {
  const Caller alice = *gate_->Identify(KeyFor("alice", Role::kSubmitter).text, "a");
  const Caller viewer = *gate_->Identify(KeyFor("alice", Role::kViewer).text, "a");
  EXPECT_TRUE(Check(alice, Action::kRead, "castle").ok());
  EXPECT_TRUE(Check(alice, Action::kChange, "castle").ok());
  EXPECT_TRUE(Check(viewer, Action::kRead, "castle").ok());
  EXPECT_TRUE(absl::IsPermissionDenied(Check(viewer, Action::kChange, "castle")));
  for (const char* id : {"tower", "old"}) {
    std::string other = Check(alice, Action::kRead, id).ToString();
    EXPECT_EQ(other, NoSuchReconstruction(id).ToString());
    EXPECT_EQ(Check(alice, Action::kChange, id), NoSuchReconstruction(id));
  }
  EXPECT_EQ(Check(alice, Action::kRead, "none"), NoSuchReconstruction("none"));
  EXPECT_TRUE(Check(Root(), Action::kChange, "tower").ok());
  EXPECT_TRUE(Check(Root(), Action::kRead, "old").ok());
  const Caller worker = *gate_->Identify("join the workers", "w");
  EXPECT_TRUE(Check(worker, Action::kWork, "").ok());
  EXPECT_TRUE(absl::IsPermissionDenied(Check(worker, Action::kRead, "castle")));
  EXPECT_TRUE(absl::IsPermissionDenied(Check(Root(), Action::kWork, "")));
}

TEST_F(GatekeeperTest, ShareLinksReadOneReconstructionUntilTheyExpire) {
  const Caller alice = *gate_->Identify(KeyFor("alice", Role::kSubmitter).text, "a");
  EXPECT_EQ(gate_->Create(alice, {.reconstruction = "tower"}).status(), NoSuchReconstruction("tower"));
  EXPECT_TRUE(absl::IsPermissionDenied(gate_->Create(alice, {.user = "eve", .role = Role::kOperator}).status()));
  const auto link = gate_->Create(alice, {.reconstruction = "castle", .lifetime = absl::Hours(1)});
  ASSERT_TRUE(link.ok()) << link.status();
  const Caller guest = *gate_->Identify(link->text, "g");
  EXPECT_TRUE(Check(guest, Action::kRead, "castle").ok());
  EXPECT_EQ(Check(guest, Action::kRead, "tower"), NoSuchReconstruction("tower"));
  EXPECT_TRUE(absl::IsPermissionDenied(Check(guest, Action::kChange, "castle")));
  EXPECT_TRUE(absl::IsPermissionDenied(Check(guest, Action::kList, "")));
  EXPECT_TRUE(absl::IsPermissionDenied(gate_->Create(guest, {.reconstruction = "castle"}).status()));
  // Others neither see nor revoke it.
  const Caller bob = *gate_->Identify(KeyFor("bob", Role::kSubmitter).text, "b");
  EXPECT_TRUE(absl::IsNotFound(gate_->Revoke(bob, link->token.id)));
  EXPECT_EQ(gate_->List(bob)->size(), 1U);
  EXPECT_EQ(gate_->List(alice)->size(), 2U);
  clock_.Advance(absl::Hours(2));
  EXPECT_TRUE(absl::IsUnauthenticated(gate_->Identify(link->text, "g").status()));
}

TEST_F(GatekeeperTest, UsersHaveQuotasAndOperatorsNone) {
  const Caller alice = *gate_->Identify(KeyFor("alice", Role::kSubmitter).text, "a");
  EXPECT_TRUE(gate_->CheckReconstructions(alice).ok());
  MW_CHECK(store_
               ->CreateReconstruction(
                   {.id = "second", .options_json = "{}", .state = ReconstructionState::kCreated, .owner = "alice"},
                   clock_.Now())
               .ok());
  EXPECT_TRUE(absl::IsResourceExhausted(gate_->CheckReconstructions(alice)));
  EXPECT_TRUE(gate_->CheckReconstructions(Root()).ok());
  MW_CHECK(store_->PutSceneFile("castle", {"x", 60, std::string(64, 'a')}).ok());
  // What is on its way counts, the same file once.
  EXPECT_TRUE(gate_->ReserveSceneBytes("second", "a", 30).ok());
  EXPECT_TRUE(gate_->ReserveSceneBytes("second", "a", 40).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(gate_->ReserveSceneBytes("second", "a", 41)));
  EXPECT_TRUE(absl::IsResourceExhausted(gate_->ReserveSceneBytes("castle", "b", 1)));
  gate_->ReleaseSceneBytes("second", "a");
  EXPECT_TRUE(gate_->ReserveSceneBytes("castle", "b", 40).ok());
  gate_->ReleaseSceneBytes("castle");
  EXPECT_TRUE(gate_->ReserveSceneBytes("castle", "c", 40).ok());
  clock_.Advance(absl::Hours(24 * 8));
  EXPECT_TRUE(gate_->ReserveSceneBytes("second", "a", 40).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(gate_->ReserveSceneBytes("second", "b", int64_t{1} << 62)));
  EXPECT_TRUE(gate_->ReserveSceneBytes("old", "a", 1000).ok());
}

TEST_F(GatekeeperTest, RequestsASecondAreLimited) {
  const NewKey alice = KeyFor("alice", Role::kSubmitter);
  int served = 0;
  for (int i = 0; i < 300; ++i) served += gate_->Identify(alice.text, "a").ok() ? 1 : 0;
  EXPECT_EQ(served, 100);
  EXPECT_TRUE(absl::IsResourceExhausted(gate_->Identify(alice.text, "b").status()));
  EXPECT_TRUE(gate_->Identify(KeyFor("bob", Role::kSubmitter).text, "a").ok());
  // Who guesses is answered no more, at a tenth of it.
  int answered = 0;
  for (int i = 0; i < 100; ++i) answered += absl::IsUnauthenticated(gate_->Identify("guess", "c").status()) ? 1 : 0;
  EXPECT_EQ(answered, 10);
}

TEST_F(GatekeeperTest, WhoDidWhatFromWhereIsTold) {
  const Caller alice = *gate_->Identify(KeyFor("alice", Role::kSubmitter).text, "10.1.2.3");
  told_.clear();
  EXPECT_TRUE(Check(alice, Action::kRead, "castle").ok());
  EXPECT_TRUE(told_.empty());
  EXPECT_TRUE(Check(alice, Action::kChange, "castle").ok());
  EXPECT_FALSE(Check(alice, Action::kChange, "tower").ok());
  EXPECT_FALSE(gate_->Identify("guess", "10.6.6.6").ok());
  ASSERT_EQ(told_.size(), 3U);
  EXPECT_EQ(told_[0].caller.user, "alice");
  EXPECT_EQ(told_[0].caller.address, "10.1.2.3");
  EXPECT_TRUE(told_[0].outcome.ok());
  EXPECT_TRUE(absl::IsNotFound(told_[1].outcome));
  EXPECT_EQ(told_[2].caller.address, "10.6.6.6");
  for (int i = 0; i < 1000; ++i) gate_->Identify("guess", "10.6.6.6").IgnoreError();
  EXPECT_LE(told_.size(), 25U);  // a flood fills no disk
  EXPECT_EQ(refusals_, 1002);
}

TEST_F(GatekeeperTest, UsersHavePlainNames) {
  for (const std::string& user : {std::string(), std::string("a b"), std::string("a\n"), std::string(65, 'a')}) {
    const absl::Status status = gate_->Create(Root(), {.user = user}).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << user;
    EXPECT_THAT(status.ToString(), HasSubstr("user: "));
  }
  EXPECT_TRUE(gate_->Create(Root(), {.user = "a.b@example.org"}).ok());
}

}  // namespace
}  // namespace meshwright
