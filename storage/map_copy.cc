#include "storage/map_copy.h"

#include <absl/container/flat_hash_set.h>

#include <array>
#include <functional>
#include <utility>

#include "storage/map_history.h"
#include "storage/map_purge.h"
#include "storage/map_store_state.h"
#include "storage/sealed_history.h"
#include "storage/session_cleanup.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr size_t kBytesAtOnce = size_t{16} << 20;
constexpr size_t kRowsAtOnce = 1000;
constexpr double kCopySeconds = 7 * 86400;  ///< a copy that is not finished after this long was left behind
constexpr std::array<std::string_view, 7> kHistory = {"root/",       "commit/",    "applied/", "withdrawn/",
                                                      "superseded/", "unsettled/", "tags"};

/// One copy of one map.
class Copier {
 public:
  Copier(const Engine& from, Engine& to, uint64_t source, uint64_t target)
      : from_(from), to_(to), source_(source), target_(target), caches_(0), values_(from, caches_, source) {}

  absl::Status CopyAll(const Progress& progress) {
    if (absl::Status status = CopyRow(kHeadRow); !status.ok()) return status;
    if (absl::Status status = CopyRow(kOldestRow); !status.ok()) return status;
    const absl::StatusOr<uint64_t> sealed = SealedEpochs(from_, source_);
    if (!sealed.ok()) return sealed.status();
    if (absl::Status status = CopySegments(*sealed); !status.ok()) return status;
    for (const std::string_view prefix : kHistory) {
      const std::string end = prefix.back() == '/' ? EndOf(prefix) : Text(prefix, std::string(1, '\0'));
      if (absl::Status status = CopyRows(prefix, end); !status.ok()) return status;
    }
    std::vector<EpochState> epochs;
    absl::Status decoded;
    const absl::Status scanned =
        from_.Scan(HeadPartition(source_), "root/", EndOf("root/"), [&](std::string_view, std::string_view bytes) {
          const absl::StatusOr<EpochState> epoch = DecodeEpoch(bytes);
          decoded = epoch.status();
          if (epoch.ok()) epochs.push_back(*epoch);
          return decoded.ok();
        });
    if (!scanned.ok()) return scanned;
    if (!decoded.ok()) return decoded;
    for (size_t i = 0; i < epochs.size(); ++i) {
      if (progress && !progress(static_cast<double>(i) / static_cast<double>(epochs.size()))) {
        return absl::CancelledError("the copy was stopped");
      }
      if (absl::Status status = CopyTree(epochs[i].root); !status.ok()) return status;
    }
    return Flush();
  }

  /// The content of one state as epoch 1, after the empty epoch 0.
  absl::Status CopyAsFirst(const EpochState& state, std::string_view session, double now) {
    const uint64_t attempt = Random64();
    EpochState empty, first = state;
    empty.origin = first.origin;
    first.epoch = first.sessions = 1;
    first.rollback = 0;
    CommitRecord commit{
        .epoch = 1, .session = std::string(session), .attempt = AttemptName(session, attempt), .time = now};
    if (state.root) {
      if (absl::Status status = ListTiles(NameOfRoot(*state.root), &commit.touched_tiles); !status.ok()) return status;
    }
    const std::string row = EncodeRow(first);
    rows_ = {{std::string(kHeadRow), row},
             {RootRow(0), EncodeRow(empty)},
             {RootRow(1), row},
             {CommitRowKey(1), EncodeRow(commit)},
             {AppliedRowKey(session), EncodeRow(Applied{1, attempt})}};
    if (absl::Status status = FlushRows(); !status.ok()) return status;
    if (absl::Status status = CopyTree(state.root); !status.ok()) return status;
    return Flush();
  }

  /// The map as of one epoch, which becomes the head of the copy and its oldest epoch.
  absl::Status CopyEpoch(const EpochState& state) {
    const std::string row = EncodeRow(state);
    rows_ = {
        {std::string(kHeadRow), row}, {RootRow(state.epoch), row}, {std::string(kOldestRow), EncodeRow(state.epoch)}};
    if (absl::Status status = CopyRecords(state.epoch); !status.ok()) return status;
    const auto history = CompareHistories(from_, source_, state.epoch, 0);
    if (!history.ok()) return history.status();
    for (const CommitRecord& commit : history->only_a) {
      rows_.push_back({AppliedRowKey(commit.session), EncodeRow(Applied{commit.epoch, AttemptOf(commit)})});
    }
    if (absl::Status status = FlushRows(); !status.ok()) return status;
    if (absl::Status status = CopyTree(state.root); !status.ok()) return status;
    return Flush();
  }

 private:
  /// The segments of sealed records up to an epoch with which one ends.
  absl::Status CopySegments(uint64_t end) {
    for (uint64_t first = 1; first <= end; first += kSegmentEpochs) {
      absl::StatusOr<std::string> value = from_.GetValue(HistoryGroup(source_), SegmentKey(first));
      if (!value.ok()) return value.status();
      const ImmutableValue copied{SegmentKey(first), *std::move(value)};
      const absl::Status put = to_.PutValues(HistoryGroup(target_), {&copied, 1});
      if (!put.ok()) return put;
    }
    if (end > 0) rows_.push_back({std::string(kSealedRow), EncodeRow(end)});
    return absl::OkStatus();
  }

  /// The records up to an epoch: whole segments as they are, the rest as rows.
  absl::Status CopyRecords(uint64_t epoch) {
    const absl::StatusOr<uint64_t> sealed = SealedEpochs(from_, source_);
    if (!sealed.ok()) return sealed.status();
    const uint64_t whole = std::min(*sealed, epoch) / kSegmentEpochs * kSegmentEpochs;
    if (absl::Status status = CopySegments(whole); !status.ok()) return status;
    for (uint64_t next = whole + 1; next <= epoch; ++next) {
      const absl::StatusOr<CommitRecord> commit = ReadCommit(from_, source_, next);
      if (!commit.ok()) return commit.status();
      rows_.push_back({CommitRowKey(next), EncodeRow(*commit)});
      if (rows_.size() < kRowsAtOnce) continue;
      if (absl::Status status = FlushRows(); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  absl::Status CopyRow(std::string_view key) {
    absl::StatusOr<std::optional<std::string>> row = from_.Get(HeadPartition(source_), key);
    if (!row.ok()) return row.status();
    if (*row) rows_.push_back({std::string(key), **std::move(row)});
    return absl::OkStatus();
  }

  absl::Status CopyRows(std::string_view begin, std::string_view end) {
    absl::Status written;
    const absl::Status scanned =
        from_.Scan(HeadPartition(source_), begin, end, [&](std::string_view key, std::string_view row) {
          rows_.push_back({std::string(key), std::string(row)});
          if (rows_.size() >= kRowsAtOnce) written = FlushRows();
          return written.ok();
        });
    if (!scanned.ok()) return scanned;
    return written.ok() ? FlushRows() : written;
  }

  absl::Status FlushRows() {
    if (rows_.empty()) return absl::OkStatus();
    absl::Status written = to_.Write(HeadPartition(target_), rows_, Durability::kBuffered);
    rows_.clear();
    return written;
  }

  absl::Status CopyTree(const TreeRoot& root) { return root ? CopyValue(NameOfRoot(*root)) : absl::OkStatus(); }

  /// Parents before children: what a copy that is broken off leaves is then found from the head.
  absl::Status CopyValue(const ValueName& name) {
    if (!copied_.insert(name).second) return absl::OkStatus();
    absl::StatusOr<std::string> value = from_.GetValue(GroupOf(source_, name), KeyOf(name));
    if (!value.ok()) return value.status();
    bytes_ += value->size();
    const std::string group = GroupOf(target_, name);
    if (groups_.empty() || groups_.back().group != group) groups_.push_back({group, {}});
    groups_.back().values.push_back({KeyOf(name), *std::move(value)});
    if (bytes_ >= kBytesAtOnce) {
      if (absl::Status status = Flush(); !status.ok()) return status;
    }
    if (name.kind == ValueKind::kBlock) return absl::OkStatus();
    const auto node = values_.ReadNode(name);
    if (!node.ok()) return node.status();
    for (const TreeChild& child : (*node)->children) {
      absl::Status status = CopyValue(NameOfChild((*node)->level, (*node)->prefix, child));
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  /// The tiles below a node, in order.
  absl::Status ListTiles(const ValueName& name, std::vector<TileKey>* tiles) const {
    if (name.kind == ValueKind::kLeaf) {
      tiles->push_back(TileKey{static_cast<uint32_t>(name.place)});
      return absl::OkStatus();
    }
    const auto node = values_.ReadNode(name);
    if (!node.ok()) return node.status();
    for (const TreeChild& child : (*node)->children) {
      absl::Status status = ListTiles(NameOfChild((*node)->level, (*node)->prefix, child), tiles);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  absl::Status Flush() {
    bytes_ = 0;
    absl::Status written = to_.PutGroups(groups_);
    groups_.clear();
    return written;
  }

  const Engine& from_;
  Engine& to_;
  const uint64_t source_, target_;
  MapCaches caches_;
  const MapValues values_;
  std::vector<Mutation> rows_;
  std::vector<ValueGroup> groups_;
  size_t bytes_ = 0;
  absl::flat_hash_set<ValueName> copied_;
};

/// Sessions of a map, with whatever values they have.
absl::Status CopySessions(const Engine& from, Engine& to, std::string_view map, std::string_view as) {
  std::vector<Mutation> rows;
  struct Incarnation {
    uint64_t source, target;
    uint32_t durable_scans;
  };
  std::vector<Incarnation> incarnations;
  absl::Status decoded;
  const std::string sessions = SessionRowKey("");
  const absl::Status scanned =
      from.Scan(SessionPartition(map), "", "", [&](std::string_view key, std::string_view bytes) {
        rows.push_back({std::string(key), std::string(bytes)});
        if (!key.starts_with(sessions)) return true;
        absl::StatusOr<StoredSession> session = DecodeSession(bytes);
        decoded = session.status();
        if (!decoded.ok()) return false;
        // Values of its own: the copy may lie beside the original.
        incarnations.push_back({session->incarnation, Random64(), session->record.durable_scans});
        session->incarnation = incarnations.back().target;
        rows.back().value = EncodeSession(*session);
        return true;
      });
  if (!scanned.ok()) return scanned;
  if (!decoded.ok()) return decoded;
  for (const auto& [source, target, durable_scans] : incarnations) {
    std::vector<std::string> keys;
    const std::string end = ScanKey(durable_scans);  // beyond it, what is listed need not be there
    absl::Status listed = from.ScanValueKeys(SessionGroup(source), "", "", [&](std::string_view key) {
      if (key < end || !key.starts_with(kScanPrefix)) keys.emplace_back(key);
      return true;
    });
    for (auto key = keys.begin(); listed.ok() && key != keys.end(); ++key) {
      absl::StatusOr<std::string> value = from.GetValue(SessionGroup(source), *key);
      if (!value.ok()) return value.status();
      const ImmutableValue copied{*key, *std::move(value)};
      listed = to.PutValues(SessionGroup(target), {&copied, 1});
    }
    if (!listed.ok()) return listed;
  }
  const std::vector<Mutation> known = {{SessionMapRow(as), EncodeRow(Random64())}};
  if (absl::Status status = to.Write(kSessionMaps, known, Durability::kBuffered); !status.ok()) return status;
  for (size_t at = 0; at < rows.size(); at += kRowsAtOnce) {
    const std::span some = std::span<const Mutation>(rows).subspan(at, std::min(kRowsAtOnce, rows.size() - at));
    if (absl::Status status = to.Write(SessionPartition(as), some, Durability::kBuffered); !status.ok()) return status;
  }
  return absl::OkStatus();
}

/// Makes a map of a name of its own, which `fill` fills from the source's incarnation, known in one last step.
absl::Status CopyInto(const Engine& from, Engine& to, std::string_view map, std::string_view as,
                      const std::function<absl::Status(Copier& copier, uint64_t source)>& fill) {
  const auto row = ReadRow(from, kCatalogue, CatalogueRow(map), DecodeMap);
  if (!row.ok()) return row.status();
  if (!*row) return absl::NotFoundError(Text("there is no map ", map));
  const absl::Status taken = absl::AlreadyExistsError(Text("there is a map ", as, " already"));
  const absl::StatusOr<std::optional<std::string>> there = to.Get(kCatalogue, CatalogueRow(as));
  if (!there.ok()) return there.status();
  if (*there) return taken;

  const uint64_t source = (*row)->value.incarnation;
  MapRecord copy = (*row)->value;
  copy.name = as;
  copy.incarnation = Random64();
  const std::string copy_row = EncodeRow(copy);
  // As MapStore::Create: the name last, and an order to remove what a crash leaves.
  const std::string order = EncodeRow(PurgeOrder{copy.incarnation, SystemSeconds() + kCopySeconds, false});
  const std::vector<Mutation> begin = {{PurgeRowKey(copy.incarnation), order}};
  if (absl::Status status = to.Write(kCatalogue, begin, Durability::kDurable); !status.ok()) return status;
  const std::vector<Mutation> map_row = {{std::string(kMapRow), copy_row}};
  if (absl::Status status = to.Write(HeadPartition(copy.incarnation), map_row, Durability::kBuffered); !status.ok()) {
    return status;
  }
  Copier copier(from, to, source, copy.incarnation);
  absl::Status copied = fill(copier, source);
  const std::vector<Condition> conditions = {{CatalogueRow(as), std::nullopt}, {PurgeRowKey(copy.incarnation), order}};
  const std::vector<Mutation> named = {{CatalogueRow(as), copy_row}, {PurgeRowKey(copy.incarnation), std::nullopt}};
  if (copied.ok()) copied = to.CompareAndSet(kCatalogue, conditions, named);
  if (copied.ok()) return copied;
  // Nobody knows the copy: what of it does not go now goes with the order.
  if (absl::StatusOr<bool> purged = PurgeMap(to, copy.incarnation, 0); purged.ok() && *purged) {
    const std::vector<Mutation> done = {{PurgeRowKey(copy.incarnation), std::nullopt}};
    to.Write(kCatalogue, done, Durability::kBuffered).IgnoreError();
  }
  return absl::IsAborted(copied) ? taken : copied;
}

}  // namespace

absl::StatusOr<std::vector<std::string>> MapNames(const Engine& engine) {
  std::vector<std::string> names;
  const std::string prefix = CatalogueRow("");
  const absl::Status scanned =
      engine.Scan(kCatalogue, prefix, EndOf(prefix), [&](std::string_view key, std::string_view) {
        names.emplace_back(key.substr(prefix.size()));
        return true;
      });
  if (!scanned.ok()) return scanned;
  return names;
}

absl::Status CopyMap(const Engine& from, Engine& to, std::string_view map, std::string_view as,
                     std::optional<uint64_t> epoch, const Progress& progress) {
  return CopyInto(from, to, map, as, [&](Copier& copier, uint64_t source) -> absl::Status {
    if (!epoch) {
      if (absl::Status status = copier.CopyAll(progress); !status.ok()) return status;
      return CopySessions(from, to, map, as);
    }
    const auto state = ReadRow(from, HeadPartition(source), RootRow(*epoch), DecodeEpoch);
    if (!state.ok()) return state.status();
    if (!*state) return absl::FailedPreconditionError(Text("epoch ", *epoch, " is collected, or never was"));
    return copier.CopyEpoch((*state)->value);
  });
}

absl::Status AdoptMap(const Engine& from, Engine& to, std::string_view map, std::string_view as,
                      std::string_view session, const Progress& progress) {
  return CopyInto(from, to, map, as, [&](Copier& copier, uint64_t source) -> absl::Status {
    const auto state = ReadRow(from, HeadPartition(source), kHeadRow, DecodeEpoch);
    if (!state.ok()) return state.status();
    if (!*state) return absl::DataLossError(Text("map ", map, " has no head"));
    if (progress && !progress(0)) return absl::CancelledError("the copy was stopped");
    return copier.CopyAsFirst((*state)->value, session, SystemSeconds());
  });
}

}  // namespace mapkeep
