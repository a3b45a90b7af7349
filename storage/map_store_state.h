#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "storage/engine.h"
#include "storage/epoch_pins.h"
#include "storage/map_rows.h"
#include "storage/map_store.h"
#include "storage/map_values.h"

namespace mapkeep {

struct MapStore::State {
  State(Engine& engine_used, const MapStoreOptions& given)
      : engine(engine_used),
        options(given),
        caches(given.block_cache_bytes),
        pins(engine_used, given.now, given.pin_seconds) {}

  Engine& engine;
  const MapStoreOptions options;
  MapCaches caches;
  EpochPins pins;
};

struct Snapshot::State {
  MapRecord map;
  EpochState at;
  std::string row;  ///< the bytes of `at`
  MapValues values;
  std::unique_ptr<EpochPins::Hold> hold;
  Engine& engine;  ///< for what is derived: a snapshot changes nothing else
};

/// See MapStore::Open.
absl::StatusOr<std::unique_ptr<const Snapshot::State>> OpenState(MapStore::State& store, std::string_view map,
                                                                 std::optional<uint64_t> epoch);

/// See MapStore::Commit.
absl::StatusOr<CommitRecord> CommitTo(MapStore::State& store, std::string_view map, const CommitRequest& request);

/// See MapStore::Rollback.
absl::StatusOr<RollbackOutcome> RollBackTo(MapStore::State& store, std::string_view map, uint64_t epoch);

/// The map's tags; none if it never had one.
absl::StatusOr<Tags> ReadTags(const Engine& engine, uint64_t incarnation);

/// The record of the commit that applied the session to this incarnation, if one did.
absl::StatusOr<std::optional<CommitRecord>> FindCommitIn(const Engine& engine, uint64_t incarnation,
                                                         std::string_view session);

}  // namespace mapkeep
