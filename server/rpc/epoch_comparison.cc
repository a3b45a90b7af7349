#include "server/rpc/epoch_comparison.h"

#include <atomic>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "server/names.h"
#include "server/rpc/convert.h"
#include "server/rpc/grpc_status.h"
#include "storage/map_diff.h"

namespace mapkeep {
namespace {

using Reactor = grpc::ServerWriteReactor<v1::CompareEpochsResponse>;

// Alternates between a step on the pool, which fills the next message, and its write; never both.
class EpochComparison final : public Reactor {
 public:
  EpochComparison(const ServiceContext& context, const v1::CompareEpochsRequest& request)
      : context_(context), request_(request) {
    context_.pool.Submit([this] { Open(); });
  }

  void OnWriteDone(bool ok) override {
    if (ended_) return;
    if (ok && !cancelled_) {
      context_.pool.Submit([this] { Next(); });
    } else {
      Finish(grpc::Status(grpc::StatusCode::CANCELLED, "the client went away"));
    }
  }
  void OnCancel() override { cancelled_ = true; }
  void OnDone() override { delete this; }

 private:
  void Open() {
    if (absl::Status status = OpenSnapshots(); !status.ok()) {
      Finish(ToGrpc(status));
      return;
    }
    const MapRecord& map = after_->map();
    v1::TileStreamHeader& header = *response_.mutable_header();
    header.set_epoch(after_->epoch());
    header.set_voxel_size(map.voxel_size);
    if (map.origin) *header.mutable_origin() = ToProto(*map.origin);
    header.set_crs(map.crs);
    StartWrite(&response_);
  }

  absl::Status OpenSnapshots() {
    if (absl::Status status = CheckName("map name", request_.map()); !status.ok()) return status;
    auto before = context_.maps.Open(request_.map(), request_.before());
    if (!before.ok()) return before.status();
    before_ = *std::move(before);
    auto after =
        context_.maps.Open(request_.map(), request_.has_after() ? std::optional(request_.after()) : std::nullopt);
    if (!after.ok()) return after.status();
    after_ = *std::move(after);
    auto blocks = after_->BlocksChangedSince(*before_);
    if (!blocks.ok()) return blocks.status();
    blocks_ = *std::move(blocks);
    return absl::OkStatus();
  }

  void Next() {
    while (!cancelled_) {
      if (next_ == blocks_.size()) {
        EndWithObjects();
        return;
      }
      auto change = ChangeOf(*before_, *after_, blocks_[next_++]);
      if (!change.ok()) {
        Finish(ToGrpc(change.status()));
        return;
      }
      auto appeared = ToProto(change->appeared, std::nullopt, true);
      auto disappeared = ToProto(change->disappeared, std::nullopt, true);
      auto unstable = ToProto(change->unstable, std::nullopt, true);
      if (change->empty()) continue;
      v1::BlockChange& message = *response_.mutable_change();
      message.Clear();
      if (appeared) *message.mutable_appeared() = *std::move(appeared);
      if (disappeared) *message.mutable_disappeared() = *std::move(disappeared);
      if (unstable) *message.mutable_unstable() = *std::move(unstable);
      Collect(*std::move(change));
      StartWrite(&response_);
      return;
    }
    Finish(grpc::Status(grpc::StatusCode::CANCELLED, "the client went away"));
  }

  void Collect(BlockChange change) {
    voxels_ += change.appeared.voxels.size() + change.disappeared.voxels.size() + change.unstable.voxels.size();
    if (voxels_ > kMostGroupedVoxels) {
      changes_ = {};
    } else {
      changes_.push_back(std::move(change));
    }
  }

  void EndWithObjects() {
    v1::ChangedObjects& message = *response_.mutable_objects();
    if (voxels_ > kMostGroupedVoxels) {
      message.set_too_many(true);
    } else {
      const auto objects = ChangedObjectsBetween(*before_, *after_, changes_);
      if (!objects.ok()) {
        Finish(ToGrpc(objects.status()));
        return;
      }
      for (const ChangedObject& object : *objects) *message.add_objects() = ToProto(object);
    }
    ended_ = true;
    StartWriteAndFinish(&response_, {}, grpc::Status::OK);
  }

  const ServiceContext context_;
  const v1::CompareEpochsRequest request_;
  std::atomic<bool> cancelled_ = false;
  v1::CompareEpochsResponse response_;
  std::unique_ptr<Snapshot> before_, after_;
  std::vector<BlockKey> blocks_;
  size_t next_ = 0;
  std::vector<BlockChange> changes_;
  uint64_t voxels_ = 0;
  bool ended_ = false;  // the last write finishes the call by itself
};

}  // namespace

Reactor* NewEpochComparison(const ServiceContext& context, const v1::CompareEpochsRequest& request) {
  return new EpochComparison(context, request);
}

}  // namespace mapkeep
