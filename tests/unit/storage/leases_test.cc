#include "storage/leases.h"

#include <gmock/gmock.h>

#include "storage/map_store.h"
#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

class LeasesTest : public testing::Test {
 protected:
  LeasesTest() { EXPECT_DONE(maps_->Create({.name = "m"})); }

  double now_ = 1000;
  TestEngine engine_;
  std::unique_ptr<MapStore> maps_ = OpenMapStore(*engine_, {});
  std::unique_ptr<Leases> leases_ = OpenLeases(*engine_, [this] { return now_; });
};

TEST_F(LeasesTest, OneHolderAtATime) {
  const auto lease = leases_->Acquire("m", "s", "a", 10);
  ASSERT_DONE(lease);
  EXPECT_EQ(lease->expires, 1010);
  const absl::Status refused = leases_->Acquire("m", "s", "b", 10).status();
  EXPECT_CODE(refused, kAborted);
  EXPECT_THAT(std::string(refused.message()), testing::HasSubstr("leased to a"));
  EXPECT_DONE(leases_->Acquire("m", "other", "b", 10));
}

TEST_F(LeasesTest, AnExpiredLeaseIsTakenOverUnderAHigherFence) {
  const Lease first = *leases_->Acquire("m", "s", "a", 10);
  now_ = 1011;
  const auto second = leases_->Acquire("m", "s", "b", 10);
  ASSERT_DONE(second);
  EXPECT_GT(second->fence, first.fence);
  EXPECT_CODE(leases_->Renew(first, 10), kAborted);
  EXPECT_DONE(leases_->Release(first)) << "releasing what was taken over is fine";
  EXPECT_DONE(leases_->Renew(*second, 10)) << "and takes nothing from the new holder";
}

TEST_F(LeasesTest, ARestartedHolderGoesOnAtOnce) {
  const Lease first = *leases_->Acquire("m", "s", "a", 10);
  const auto again = leases_->Acquire("m", "s", "a", 10);
  ASSERT_DONE(again);
  EXPECT_GT(again->fence, first.fence);
  EXPECT_CODE(leases_->Renew(first, 10), kAborted);
}

TEST_F(LeasesTest, RenewingKeepsTheFenceAndMovesTheEnd) {
  const Lease lease = *leases_->Acquire("m", "s", "a", 10);
  now_ = 1009;
  const auto renewed = leases_->Renew(lease, 10);
  ASSERT_DONE(renewed);
  EXPECT_EQ(renewed->fence, lease.fence);
  now_ = 1018;
  EXPECT_CODE(leases_->Acquire("m", "s", "b", 10), kAborted);
}

TEST_F(LeasesTest, AReleasedFenceNeverComesBack) {
  const Lease first = *leases_->Acquire("m", "s", "a", 10);
  EXPECT_DONE(leases_->Release(first));
  const auto second = leases_->Acquire("m", "s", "b", 10);
  ASSERT_DONE(second);
  EXPECT_GT(second->fence, first.fence);
}

TEST_F(LeasesTest, ThereIsNoLeaseWithoutAMap) {
  EXPECT_CODE(leases_->Acquire("none", "s", "a", 10), kNotFound);
  const Lease lease = *leases_->Acquire("m", "s", "a", 10);
  EXPECT_DONE(maps_->Delete("m"));
  EXPECT_CODE(leases_->Renew(lease, 10), kAborted);
  EXPECT_DONE(leases_->Release(lease));
}

}  // namespace
}  // namespace mapkeep
