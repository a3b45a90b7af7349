#include "storage/collector.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "storage/map_purge.h"
#include "storage/map_rows.h"
#include "storage/map_values.h"
#include "storage/sealed_history.h"
#include "storage/session_cleanup.h"

namespace mapkeep {
namespace {

constexpr size_t kRowsAtOnce = 100;
constexpr size_t kTreeCache = size_t{32} << 20;  ///< bytes of tree nodes of tagged epochs

struct Row {
  std::string key, bytes;
};

/// Up to `limit` rows of [begin, end of the prefix).
absl::StatusOr<std::vector<Row>> RowsFrom(const Engine& engine, std::string_view partition, std::string_view prefix,
                                          std::string_view begin, size_t limit) {
  std::vector<Row> rows;
  const absl::Status scanned =
      engine.Scan(partition, begin, EndOf(prefix), [&](std::string_view key, std::string_view bytes) {
        rows.push_back({std::string(key), std::string(bytes)});
        return rows.size() < limit;
      });
  if (!scanned.ok()) return scanned;
  return rows;
}

absl::StatusOr<std::vector<Row>> RowsOf(const Engine& engine, std::string_view partition, std::string_view prefix) {
  return RowsFrom(engine, partition, prefix, prefix, SIZE_MAX);
}

/// Deletes the rows if the first is as it was found. Whether it was.
absl::StatusOr<bool> DeleteIfSame(Engine& engine, const std::string& partition, const Row& row,
                                  const std::vector<std::string>& others = {}) {
  const std::vector<Condition> conditions = {{row.key, row.bytes}};
  std::vector<Mutation> mutations = {{row.key, std::nullopt}};
  for (const std::string& other : others) mutations.push_back({other, std::nullopt});
  const absl::Status deleted = engine.CompareAndSet(partition, conditions, mutations);
  if (absl::IsAborted(deleted)) return false;
  if (!deleted.ok()) return deleted;
  return true;
}

/// One map's collection.
class MapCollector {
 public:
  MapCollector(Engine& engine, const GarbageOptions& options, uint64_t incarnation, std::function<bool()> progress,
               GarbageCounts& counts)
      : engine_(engine),
        options_(options),
        incarnation_(incarnation),
        partition_(HeadPartition(incarnation)),
        dead_(options.now() - options.grace_seconds),
        values_(engine, caches_, incarnation),
        progress_(std::move(progress)),
        counts_(counts) {}

  absl::Status Run() {
    if (absl::Status status = EndAttempts(); !status.ok()) return status;
    if (absl::Status status = DropStaged(); !status.ok()) return status;
    if (absl::Status status = DropLeases(); !status.ok()) return status;
    absl::StatusOr<uint64_t> oldest = RaiseOldest();
    if (!oldest.ok()) return oldest.status();
    if (absl::Status status = ReadTagged(*oldest); !status.ok()) return status;
    const absl::StatusOr<uint64_t> pinned = LowestPin(*oldest);
    if (!pinned.ok()) return pinned.status();
    if (absl::Status status = DropSuperseded(*pinned); !status.ok()) return status;
    return SealHistory(engine_, incarnation_);
  }

 private:
  absl::Status EndAttempts() {
    const absl::StatusOr<std::vector<Row>> rows = RowsOf(engine_, partition_, "intent/");
    if (!rows.ok()) return rows.status();
    for (const Row& row : *rows) {
      const absl::StatusOr<Intent> intent = DecodeIntent(row.bytes);
      if (!intent.ok()) return intent.status();
      if (intent->expires > dead_) continue;
      const absl::StatusOr<bool> ended = DeleteIfSame(engine_, partition_, row);
      if (!ended.ok()) return ended.status();
      counts_.attempts += *ended ? 1 : 0;
    }
    return absl::OkStatus();
  }

  absl::Status DropStaged() {
    const absl::StatusOr<std::vector<Row>> rows = RowsOf(engine_, partition_, "staged/");
    if (!rows.ok()) return rows.status();
    for (const Row& row : *rows) {
      const absl::StatusOr<Staged> staged = DecodeStaged(row.bytes);
      if (!staged.ok()) return staged.status();
      // Intent and announcement are written together and a commit deletes them together: one without the other, read in
      // this order, is what an ended attempt left.
      const auto intent = engine_.Get(partition_, IntentRowKey(staged->attempt));
      if (!intent.ok()) return intent.status();
      if (*intent) continue;
      const auto again = engine_.Get(partition_, row.key);
      if (!again.ok()) return again.status();
      if (*again != row.bytes) continue;
      const auto applied = ReadRow(engine_, partition_, AppliedRowKey(staged->session), DecodeApplied);
      if (!applied.ok()) return applied.status();
      const auto withdrawn = engine_.Get(partition_, WithdrawnRowKey(staged->session, staged->attempt));
      if (!withdrawn.ok()) return withdrawn.status();
      const bool committed = (*applied && (*applied)->value.attempt == staged->attempt) || *withdrawn;
      if (!committed) {
        if (absl::Status status = DeleteNamed(engine_, incarnation_, staged->values); !status.ok()) return status;
        counts_.values += staged->values.size();
      }
      const absl::StatusOr<bool> dropped = DeleteIfSame(engine_, partition_, row);
      if (!dropped.ok()) return dropped.status();
    }
    return absl::OkStatus();
  }

  /// The fence of a lease is never given again, so dropping an expired one lets nobody back in.
  absl::Status DropLeases() {
    const std::string prefix = LeaseRowKey("");
    const absl::StatusOr<std::vector<Row>> rows = RowsOf(engine_, partition_, prefix);
    if (!rows.ok()) return rows.status();
    for (const Row& row : *rows) {
      const absl::StatusOr<LeaseEntry> lease = DecodeLease(row.bytes);
      if (!lease.ok()) return lease.status();
      if (lease->expires > dead_) continue;
      const absl::StatusOr<bool> dropped =
          DeleteIfSame(engine_, partition_, row, {SessionFenceRow(row.key.substr(prefix.size()))});
      if (!dropped.ok()) return dropped.status();
    }
    return absl::OkStatus();
  }

  /// Closes the epochs that are not to be kept to new readers; gives the oldest one open.
  absl::StatusOr<uint64_t> RaiseOldest() {
    const auto head = ReadRow(engine_, partition_, kHeadRow, DecodeEpoch);
    if (!head.ok()) return head.status();
    if (!*head) return uint64_t{0};  // being deleted
    const auto oldest = ReadRow(engine_, partition_, kOldestRow, DecodeNumber);
    if (!oldest.ok()) return oldest.status();
    const uint64_t before = *oldest ? (*oldest)->value : 0;
    const uint64_t newest = (*head)->value.epoch;
    const uint64_t keep = std::max<uint64_t>(options_.keep_epochs, 1);
    const absl::StatusOr<uint64_t> young = FirstYoung(before, newest + 1 > keep ? newest + 1 - keep : 0);
    if (!young.ok()) return young.status();
    const uint64_t wanted = *young;
    if (wanted <= before) return before;
    const auto map = engine_.Get(partition_, kMapRow);
    if (!map.ok()) return map.status();
    const std::vector<Condition> conditions = {
        {std::string(kMapRow), *map},
        {std::string(kOldestRow), *oldest ? std::optional((*oldest)->bytes) : std::nullopt}};
    const std::vector<Mutation> mutations = {{std::string(kOldestRow), EncodeRow(wanted)}};
    const absl::Status raised = engine_.CompareAndSet(partition_, conditions, mutations);
    if (absl::IsAborted(raised)) return before;  // another collector is at it
    if (!raised.ok()) return raised;
    counts_.epochs += wanted - before;
    return wanted;
  }

  /// The first epoch of [from, end] that is to stay for its age, or `end`. An epoch ages from the commit that replaced
  /// it.
  absl::StatusOr<uint64_t> FirstYoung(uint64_t from, uint64_t end) {
    if (options_.keep_seconds <= 0) return end;
    for (uint64_t epoch = from; epoch < end; ++epoch) {
      const auto next = FindCommitRecord(engine_, incarnation_, epoch + 1);
      if (!next.ok()) return next.status();
      if (*next && (*next)->time > options_.now() - options_.keep_seconds) return epoch;
    }
    return end;
  }

  absl::Status ReadTagged(uint64_t oldest) {
    const auto tags = ReadRow(engine_, partition_, kTagsRow, DecodeTags);
    if (!tags.ok()) return tags.status();
    if (!*tags) return absl::OkStatus();
    for (const Tag& tag : (*tags)->value.tags) {
      const auto root = ReadRow(engine_, partition_, RootRow(tag.epoch), DecodeEpoch);
      if (!root.ok()) return root.status();
      if (*root) {
        tagged_.emplace(tag.epoch, (*root)->value.root);
      } else if (tag.epoch >= oldest) {
        return absl::DataLossError(absl::StrCat("the root of tagged epoch ", tag.epoch, " is missing"));
      }
    }
    return absl::OkStatus();
  }

  absl::StatusOr<uint64_t> LowestPin(uint64_t lowest) {
    const absl::StatusOr<std::vector<Row>> rows = RowsOf(engine_, partition_, "pin/");
    if (!rows.ok()) return rows.status();
    for (const Row& row : *rows) {
      const absl::StatusOr<Pin> pin = DecodePin(row.bytes);
      if (!pin.ok()) return pin.status();
      if (pin->expires <= dead_) {
        const absl::StatusOr<bool> dropped = DeleteIfSame(engine_, partition_, row);
        if (!dropped.ok()) return dropped.status();
        if (*dropped) continue;
        // Renewed this moment, from then on perhaps lower: it stands.
        const auto again = ReadRow(engine_, partition_, row.key, DecodePin);
        if (!again.ok()) return again.status();
        if (*again) lowest = std::min(lowest, (*again)->value.epoch);
        continue;
      }
      lowest = std::min(lowest, pin->epoch);
    }
    return lowest;
  }

  /// Everything that was superseded by the commit of an epoch up to `lowest`, which everybody's epochs have reached.
  absl::Status DropSuperseded(uint64_t lowest) {
    // The roots first: a root that is there always leads to a whole tree.
    if (absl::Status status = DropRoots(lowest); !status.ok()) return status;
    const std::string prefix = "superseded/";
    const std::string end = SupersededRow(lowest + 1);
    std::string begin = prefix;
    while (true) {
      const absl::StatusOr<std::vector<Row>> rows = RowsFrom(engine_, partition_, prefix, begin, kRowsAtOnce);
      if (!rows.ok()) return rows.status();
      for (const Row& row : *rows) {
        if (row.key >= end) return absl::OkStatus();
        if (absl::Status status = DropSupersededRow(row); !status.ok()) return status;
      }
      if (rows->empty()) return absl::OkStatus();
      begin = rows->back().key + '\0';
    }
  }

  /// Deletes what the row names, apart from what tagged epochs reach: that stays named.
  absl::Status DropSupersededRow(const Row& row) {
    absl::StatusOr<Superseded> superseded = DecodeSuperseded(row.bytes);
    if (!superseded.ok()) return superseded.status();
    const auto tagged = [this](uint64_t epoch) { return tagged_.contains(epoch); };
    if (!superseded->needed_by.empty() && std::ranges::all_of(superseded->needed_by, tagged)) return absl::OkStatus();
    absl::StatusOr<Superseded> kept = NeededByTags(row.key, superseded->names);
    if (!kept.ok()) return kept.status();
    std::vector<ValueName> gone;
    std::ranges::set_difference(Sorted(superseded->names), Sorted(kept->names), std::back_inserter(gone));
    if (absl::Status status = DeleteNamed(engine_, incarnation_, gone); !status.ok()) return status;
    counts_.values += gone.size();
    if (absl::Status status = Pace(gone.size()); !status.ok()) return status;
    if (kept->names.empty()) {
      const std::vector<Mutation> done = {{row.key, std::nullopt}};
      return engine_.Write(partition_, done, Durability::kBuffered);
    }
    const std::vector<Condition> conditions = {{row.key, row.bytes}};
    const std::vector<Mutation> shortened = {{row.key, EncodeRow(*kept)}};
    const absl::Status written = engine_.CompareAndSet(partition_, conditions, shortened);
    return absl::IsAborted(written) ? absl::OkStatus() : written;  // a rollback was here: the next collection sees
  }

  absl::StatusOr<Superseded> NeededByTags(const std::string& key, const std::vector<ValueName>& names) const {
    Superseded kept;
    std::vector<ValueName> open = names;
    for (const auto& [epoch, root] : tagged_) {
      if (SupersededRow(epoch + 1) > key) break;  // tagged epochs from the row's own on do not reach them
      std::vector<ValueName> left;
      const size_t before = kept.names.size();
      for (const ValueName& name : open) {
        const absl::StatusOr<bool> reached = Reaches(values_, root, name);
        if (!reached.ok()) return reached.status();
        (*reached ? kept.names : left).push_back(name);
      }
      if (kept.names.size() > before) kept.needed_by.push_back(epoch);
      open = std::move(left);
    }
    return kept;
  }

  /// Waits as long as deleting so many values may take.
  absl::Status Pace(size_t values) const {
    if (options_.values_per_second > 0) {
      std::this_thread::sleep_for(
          std::chrono::duration<double>(static_cast<double>(values) / options_.values_per_second));
    }
    if (progress_ && !progress_()) return absl::CancelledError("the collection was stopped");
    return absl::OkStatus();
  }

  static std::vector<ValueName> Sorted(std::vector<ValueName> names) {
    std::ranges::sort(names);
    return names;
  }

  absl::Status DropRoots(uint64_t lowest) {
    std::set<std::string, std::less<>> kept;
    for (const auto& [epoch, root] : tagged_) kept.insert(RootRow(epoch));
    std::vector<Mutation> roots;
    absl::Status scanned =
        engine_.Scan(partition_, RootRow(0), RootRow(lowest), [&](std::string_view key, std::string_view) {
          if (!kept.contains(key)) roots.push_back({std::string(key), std::nullopt});
          return true;
        });
    if (!scanned.ok() || roots.empty()) return scanned;
    return engine_.Write(partition_, roots, Durability::kBuffered);
  }

  Engine& engine_;
  const GarbageOptions& options_;
  const uint64_t incarnation_;
  const std::string partition_;
  const double dead_;  ///< what expired before it is over
  MapCaches caches_{kTreeCache};
  const MapValues values_;
  const std::function<bool()> progress_;  ///< whether to go on
  std::map<uint64_t, TreeRoot> tagged_;   ///< trees of the epochs that tags keep
  GarbageCounts& counts_;
};

/// Takes up a purge order: whoever is still making the map then fails. False if it was withdrawn.
absl::StatusOr<bool> BeginPurge(Engine& engine, const Row& row, PurgeOrder order) {
  if (order.begun) return true;
  order.begun = true;
  const std::vector<Condition> conditions = {{row.key, row.bytes}};
  const std::vector<Mutation> mutations = {{row.key, EncodeRow(order)}};
  const absl::Status begun = engine.CompareAndSet(kCatalogue, conditions, mutations);
  if (absl::IsAborted(begun)) return false;
  if (!begun.ok()) return begun;
  return true;
}

absl::Status PurgeMaps(Engine& engine, const GarbageOptions& options, GarbageCounts& counts) {
  const absl::StatusOr<std::vector<Row>> rows = RowsOf(engine, kCatalogue, "purge/");
  if (!rows.ok()) return rows.status();
  for (const Row& row : *rows) {
    const absl::StatusOr<PurgeOrder> order = DecodePurge(row.bytes);
    if (!order.ok()) return order.status();
    if (order->after > options.now() - options.grace_seconds) continue;
    const absl::StatusOr<bool> begun = BeginPurge(engine, row, *order);
    if (!begun.ok()) return begun.status();
    if (!*begun) continue;
    const absl::StatusOr<bool> purged = PurgeMap(engine, order->incarnation, options.now() - options.grace_seconds);
    if (!purged.ok()) return purged.status();
    if (!*purged) continue;
    const std::vector<Mutation> done = {{row.key, std::nullopt}};
    if (absl::Status status = engine.Write(kCatalogue, done, Durability::kBuffered); !status.ok()) return status;
    ++counts.maps;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<GarbageCounts> CollectGarbage(Engine& engine, const GarbageOptions& options, const Progress& progress) {
  GarbageCounts counts;
  if (absl::Status status = PurgeMaps(engine, options, counts); !status.ok()) return status;
  const absl::StatusOr<uint64_t> sessions = FinishCleanups(engine);
  if (!sessions.ok()) return sessions.status();
  counts.sessions = *sessions;
  const absl::StatusOr<std::vector<Row>> maps = RowsOf(engine, kCatalogue, CatalogueRow(""));
  if (!maps.ok()) return maps.status();
  for (size_t i = 0; i < maps->size(); ++i) {
    const auto going = [&] {
      return !progress || progress(static_cast<double>(i) / static_cast<double>(maps->size()));
    };
    if (!going()) return absl::CancelledError("the collection was stopped");
    const absl::StatusOr<MapRecord> map = DecodeMap((*maps)[i].bytes);
    if (!map.ok()) return map.status();
    absl::Status collected = MapCollector(engine, options, map->incarnation, going, counts).Run();
    if (!collected.ok()) return collected;
  }
  if (progress) progress(1);
  return counts;
}

}  // namespace mapkeep
