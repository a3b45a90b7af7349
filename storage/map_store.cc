#include "storage/map_store.h"

#include <utility>

#include "storage/map_purge.h"
#include "storage/map_store_state.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

/// A map that is not finished being made after this long was left behind by a process that died.
constexpr double kCreateSeconds = 600;

}  // namespace

std::unique_ptr<MapStore> OpenMapStore(Engine& engine, const MapStoreOptions& options) {
  return std::make_unique<MapStore>(std::make_unique<MapStore::State>(engine, options));
}

MapStore::MapStore(std::unique_ptr<State> state) : state_(std::move(state)) {}
MapStore::~MapStore() = default;

MapCacheUse MapStore::Caches() const { return {state_->caches.blocks.Use(), state_->caches.nodes.Use()}; }

absl::StatusOr<MapRecord> MapStore::Create(const MapRecord& record) {
  Engine& engine = state_->engine;
  MapRecord map = record;
  map.incarnation = Random64();
  map.created = state_->options.now();
  const std::string row = EncodeRow(map);
  const std::string head = EncodeRow(EpochState{0, 0, std::nullopt, map.origin});

  // The head first, the name last: a name always leads to a whole map. The purge order is for what a crash leaves.
  const std::string order = EncodeRow(PurgeOrder{map.incarnation, map.created + kCreateSeconds, false});
  const std::vector<Mutation> begin = {{PurgeRowKey(map.incarnation), order}};
  if (absl::Status status = engine.Write(kCatalogue, begin, Durability::kDurable); !status.ok()) return status;
  const std::vector<Mutation> rows = {{std::string(kMapRow), row}, {std::string(kHeadRow), head}, {RootRow(0), head}};
  const std::string partition = HeadPartition(map.incarnation);
  if (absl::Status status = engine.Write(partition, rows, Durability::kBuffered); !status.ok()) return status;
  const std::vector<Condition> conditions = {{CatalogueRow(map.name), std::nullopt},
                                             {PurgeRowKey(map.incarnation), order}};
  const std::vector<Mutation> mutations = {{CatalogueRow(map.name), row}, {PurgeRowKey(map.incarnation), std::nullopt}};
  const absl::Status named = engine.CompareAndSet(kCatalogue, conditions, mutations);
  if (named.ok()) return map;
  if (!absl::IsAborted(named)) return named;
  // Nobody else knows the incarnation. What fails to go now goes with the purge order.
  if (absl::StatusOr<bool> purged = PurgeMap(engine, map.incarnation, map.created); purged.ok() && *purged) {
    const std::vector<Mutation> done = {{PurgeRowKey(map.incarnation), std::nullopt}};
    engine.Write(kCatalogue, done, Durability::kBuffered).IgnoreError();
  }
  return absl::AlreadyExistsError(Text("there is a map ", map.name, " already"));
}

absl::StatusOr<MapRecord> MapStore::Find(std::string_view name) const {
  auto map = ReadRow(state_->engine, kCatalogue, CatalogueRow(name), DecodeMap);
  if (!map.ok()) return map.status();
  if (!*map) return absl::NotFoundError(Text("there is no map ", name));
  const auto head = ReadRow(state_->engine, HeadPartition((*map)->value.incarnation), kHeadRow, DecodeEpoch);
  if (!head.ok()) return head.status();
  if (!*head) return absl::NotFoundError(Text("map ", name, " is being deleted"));
  (*map)->value.origin = (*head)->value.origin;
  return (*map)->value;
}

absl::StatusOr<std::vector<MapRecord>> MapStore::List(std::string_view after, size_t limit) const {
  std::vector<std::string> names;
  const std::string first = CatalogueRow("");
  // A key ends where the next name could begin with it, so the row after `after` is the one with a zero byte added.
  const std::string begin = after.empty() ? first : CatalogueRow(after) + '\0';
  if (limit == 0) return std::vector<MapRecord>();
  const absl::Status scanned =
      state_->engine.Scan(kCatalogue, begin, EndOf(first), [&](std::string_view key, std::string_view) {
        names.emplace_back(key.substr(first.size()));
        return names.size() < limit;
      });
  if (!scanned.ok()) return scanned;
  std::vector<MapRecord> maps;
  for (const std::string& name : names) {
    absl::StatusOr<MapRecord> map = Find(name);
    if (absl::IsNotFound(map.status())) continue;  // deleted since
    if (!map.ok()) return map.status();
    maps.push_back(*std::move(map));
  }
  return maps;
}

absl::Status MapStore::Delete(std::string_view name) {
  Engine& engine = state_->engine;
  const auto map = ReadRow(engine, kCatalogue, CatalogueRow(name), DecodeMap);
  if (!map.ok()) return map.status();
  absl::Status missing = absl::NotFoundError(Text("there is no map ", name));
  if (!*map) return missing;
  const uint64_t incarnation = (*map)->value.incarnation;
  const std::vector<Condition> conditions = {{CatalogueRow(name), (*map)->bytes}};
  const std::vector<Mutation> mutations = {
      {CatalogueRow(name), std::nullopt},
      {PurgeRowKey(incarnation), EncodeRow(PurgeOrder{incarnation, 0, true})},
  };
  absl::Status removed = engine.CompareAndSet(kCatalogue, conditions, mutations);
  if (absl::IsAborted(removed)) return missing;
  if (!removed.ok()) return removed;
  // The name is gone; what is left of the map goes now, or with the collector.
  const absl::StatusOr<bool> purged = PurgeMap(engine, incarnation, state_->options.now());
  if (!purged.ok() || !*purged) return absl::OkStatus();
  const std::vector<Mutation> done = {{PurgeRowKey(incarnation), std::nullopt}};
  engine.Write(kCatalogue, done, Durability::kBuffered).IgnoreError();
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Snapshot>> MapStore::Open(std::string_view map, std::optional<uint64_t> epoch) const {
  absl::StatusOr<std::unique_ptr<const Snapshot::State>> opened = OpenState(*state_, map, epoch);
  if (!opened.ok()) return opened.status();
  return std::make_unique<Snapshot>(*std::move(opened));
}

absl::StatusOr<CommitRecord> MapStore::Commit(std::string_view map, const CommitRequest& request) {
  return CommitTo(*state_, map, request);
}

absl::StatusOr<RollbackOutcome> MapStore::Rollback(std::string_view map, uint64_t epoch) {
  return RollBackTo(*state_, map, epoch);
}

absl::StatusOr<std::optional<CommitRecord>> MapStore::FindCommit(std::string_view map, std::string_view session) const {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(state_->engine, map);
  if (!incarnation.ok()) return incarnation.status();
  return FindCommitIn(state_->engine, *incarnation, session);
}

}  // namespace mapkeep
