#include "server/rpc/map_import.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/log.h"
#include "server/names.h"
#include "server/rpc/convert.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/map_service.h"
#include "server/scratch_directory.h"
#include "storage/map_copy.h"
#include "storage/rocksdb_engine.h"

namespace mapkeep {
namespace {

constexpr size_t kVoxelsAtOnce = size_t{1} << 18;  // of a commit to the scratch store: about 16 MB
constexpr size_t kScratchCacheBytes = size_t{8} << 20;
// In the map's history. No session can have this name.
constexpr char kImport[] = "(import)";

// What has come of a map, in a store of its own.
class Arrival {
 public:
  static absl::StatusOr<std::unique_ptr<Arrival>> Begin(const ServiceContext& context, const MapRecord& map) {
    auto scratch = std::make_unique<ScratchDirectory>(context.config.data, "import");
    auto engine = OpenRocksDbEngine(scratch->path());
    if (!engine.ok()) return engine.status();
    std::unique_ptr<Arrival> arrival(new Arrival(context, map, std::move(scratch), *std::move(engine)));
    if (absl::Status status = arrival->maps_->Create(map).status(); !status.ok()) return status;
    return arrival;
  }

  absl::Status Add(const v1::VoxelBlock& message) {
    absl::StatusOr<Block> block = FromProto(message);
    if (!block.ok()) return block.status();
    if (last_ && block->key <= *last_) {
      return absl::InvalidArgumentError(
          absl::StrFormat("block (%d, %d, %d) came out of order, or twice", message.x(), message.y(), message.z()));
    }
    last_ = block->key;
    ++blocks_;
    voxels_ += block->voxels.size();
    waiting_voxels_ += block->voxels.size();
    waiting_.push_back(*std::move(block));
    return waiting_voxels_ < kVoxelsAtOnce ? absl::OkStatus() : Flush();
  }

  // The map is in the daemon's store after this.
  absl::Status Finish(const v1::ImportEnd& end, const Progress& progress) {
    if (end.blocks() != blocks_ || end.voxels() != voxels_) {
      return absl::DataLossError(absl::StrFormat("%d blocks with %d voxels came, %d with %d were sent", blocks_,
                                                 voxels_, end.blocks(), end.voxels()));
    }
    if (absl::Status status = Flush(); !status.ok()) return status;
    {
      const std::unique_lock alone(context_.map_lifetimes);
      if (absl::IsNotFound(context_.maps.Find(map_.name).status())) {
        // As when a map is created: an earlier one of the name may have left sessions.
        if (absl::Status status = context_.sessions.DeleteAll(map_.name); !status.ok()) return status;
      }
    }
    return AdoptMap(*engine_, context_.engine, map_.name, map_.name, kImport, progress);
  }

  const MapRecord& map() const { return map_; }
  uint64_t voxels() const { return voxels_; }

 private:
  Arrival(const ServiceContext& context, const MapRecord& map, std::unique_ptr<ScratchDirectory> scratch,
          std::unique_ptr<Engine> engine)
      : context_(context),
        map_(map),
        scratch_(std::move(scratch)),
        engine_(std::move(engine)),
        maps_(OpenMapStore(*engine_, {.block_cache_bytes = kScratchCacheBytes})) {}

  absl::Status Flush() {
    if (waiting_.empty()) return absl::OkStatus();
    const auto made = maps_->Commit(map_.name, {.session = absl::StrCat("part-", commits_),
                                                .base_epoch = commits_,
                                                .blocks = [this](const Snapshot&) { return waiting_; }});
    waiting_.clear();
    waiting_voxels_ = 0;
    ++commits_;
    return made.status();
  }

  const ServiceContext context_;
  const MapRecord map_;
  const std::unique_ptr<ScratchDirectory> scratch_;  // outlives the engine
  const std::unique_ptr<Engine> engine_;
  const std::unique_ptr<MapStore> maps_;
  std::vector<Block> waiting_;
  size_t waiting_voxels_ = 0;
  uint64_t blocks_ = 0, voxels_ = 0, commits_ = 0;
  std::optional<BlockKey> last_;
};

// Alternates between a read and a step on the pool, which takes what was read; never both.
class MapImport final : public grpc::ServerReadReactor<v1::ImportMapRequest> {
 public:
  MapImport(const ServiceContext& context, Call call, v1::ImportMapResponse* response)
      : context_(context), call_(std::move(call)), response_(response) {
    StartRead(&request_);
  }

  void OnReadDone(bool ok) override {
    if (ok && !cancelled_) {
      context_.pool.Submit([this] { Take(); });
    } else {
      Finish(grpc::Status(grpc::StatusCode::DATA_LOSS, "the import ended before its last message"));
    }
  }
  void OnCancel() override { cancelled_ = true; }
  void OnDone() override {
    // The scratch store takes a while to go.
    context_.pool.Submit([this] { delete this; });
  }

 private:
  void Take() {
    const LogScope scope(call_.tags());
    const absl::Status status = TakePart();
    if (!status.ok()) {
      Finish(ToGrpc(status));
    } else if (ended_) {
      Finish(grpc::Status::OK);
    } else {
      StartRead(&request_);
    }
  }

  absl::Status TakePart() {
    if (request_.has_header() && arrival_ == nullptr) return Begin(request_.header());
    if (request_.has_blocks() && arrival_ != nullptr) {
      for (const v1::VoxelBlock& block : request_.blocks().blocks()) {
        if (absl::Status status = arrival_->Add(block); !status.ok()) return status;
      }
      return absl::OkStatus();
    }
    if (request_.has_end() && arrival_ != nullptr) return End(request_.end());
    return absl::InvalidArgumentError("expected one header, then blocks, then the end");
  }

  absl::Status Begin(const v1::CreateMapRequest& header) {
    if (absl::Status status = Gate::Enter(call_, request_); !status.ok()) return status;
    const absl::StatusOr<MapRecord> map = NewMapRecord(header);
    if (!map.ok()) return map.status();
    const absl::Status found = context_.maps.Find(map->name).status();
    if (found.ok()) return absl::AlreadyExistsError(absl::StrCat("there is a map ", map->name, " already"));
    if (!absl::IsNotFound(found)) return found;
    auto arrival = Arrival::Begin(context_, *map);
    if (!arrival.ok()) return arrival.status();
    arrival_ = *std::move(arrival);
    return absl::OkStatus();
  }

  absl::Status End(const v1::ImportEnd& end) {
    absl::Status status = arrival_->Finish(end, [this](double) { return !cancelled_; });
    if (!status.ok()) return status;
    LogInfo("map imported", {{"map", arrival_->map().name}, {"voxels", arrival_->voxels()}});
    const auto snapshot = context_.maps.Open(arrival_->map().name);
    if (!snapshot.ok()) return snapshot.status();
    *response_->mutable_map() = ToProto(**snapshot);
    ended_ = true;
    return absl::OkStatus();
  }

  const ServiceContext context_;
  Call call_;
  v1::ImportMapResponse* const response_;
  std::atomic<bool> cancelled_ = false;
  v1::ImportMapRequest request_;
  std::unique_ptr<Arrival> arrival_;
  bool ended_ = false;
};

}  // namespace

grpc::ServerReadReactor<v1::ImportMapRequest>* NewMapImport(const ServiceContext& context, Call call,
                                                            v1::ImportMapResponse* response) {
  return new MapImport(context, std::move(call), response);
}

}  // namespace mapkeep
