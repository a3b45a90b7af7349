#include <absl/container/flat_hash_set.h>

#include <chrono>
#include <set>
#include <thread>
#include <utility>

#include "storage/map_history.h"
#include "storage/map_store_state.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr int kTries = 64;
constexpr auto kPause = std::chrono::milliseconds(5);

/// The change of the head partition that one rollback is. It writes no values: the new head's root is the old one.
///
/// Why it is safe beside the collector: the compare-and-set requires the oldest epoch and the tags unchanged, so that
/// the epoch brought back could still be opened when it was applied, and then each of its values was there. They are
/// not collected afterwards: those that a `superseded/...` row names leave it in the same step, and a collector that is
/// at work goes only up to an oldest epoch that is not above the one brought back, or leaves what tagged epochs reach.
class RollbackPlan {
 public:
  RollbackPlan(const Snapshot::State& head, const Snapshot::State& target, const Engine& engine)
      : head_(head), target_(target), engine_(engine), partition_(HeadPartition(head.map.incarnation)) {}

  absl::Status Make(uint64_t attempt, double now) {
    const absl::StatusOr<TreeDifference> trees = CompareTrees(head_.values, head_.at.root, target_.at.root);
    if (!trees.ok()) return trees.status();
    EpochState next = target_.at;
    next.epoch = head_.at.epoch + 1;
    next.rollback = next.epoch;
    outcome.commit = {.epoch = next.epoch,
                      .base_epoch = target_.at.epoch,
                      .attempt = AttemptName("", attempt),
                      .time = now,
                      .rollback = true,
                      .rollback_before = target_.at.rollback};
    std::set<TileKey> tiles;
    for (const BlockKey block : trees->blocks) tiles.insert(TileKeyOf(block));
    outcome.commit.touched_tiles.assign(tiles.begin(), tiles.end());

    const std::string row = EncodeRow(next);
    conditions.push_back({std::string(kHeadRow), head_.row});
    mutations.push_back({std::string(kHeadRow), row});
    mutations.push_back({RootRow(next.epoch), row});
    mutations.push_back({CommitRowKey(next.epoch), EncodeRow(outcome.commit)});
    if (!trees->only_before.empty()) {
      mutations.push_back({SupersededRow(next.epoch), EncodeRow(Superseded{trees->only_before})});
    }
    if (absl::Status status = RequireOpen(); !status.ok()) return status;
    if (absl::Status status = Revive(trees->only_after); !status.ok()) return status;
    return MoveSessions(next.epoch);
  }

  std::vector<Condition> conditions;
  std::vector<Mutation> mutations;
  RollbackOutcome outcome;

 private:
  absl::Status RequireOpen() {
    for (const std::string_view key : {kMapRow, kOldestRow, kTagsRow}) {
      absl::StatusOr<std::optional<std::string>> found = engine_.Get(partition_, key);
      if (!found.ok()) return found.status();
      conditions.push_back({std::string(key), *std::move(found)});
    }
    // The rows that are required must still let the epoch in: they may have changed since it was opened.
    const auto oldest = ReadRow(engine_, partition_, kOldestRow, DecodeNumber);
    if (!oldest.ok()) return oldest.status();
    if (!*oldest || target_.at.epoch >= (*oldest)->value) return absl::OkStatus();
    const absl::StatusOr<Tags> tags = ReadTags(engine_, head_.map.incarnation);
    if (!tags.ok()) return tags.status();
    if (IsTagged(*tags, target_.at.epoch)) return absl::OkStatus();
    return absl::FailedPreconditionError(
        Text("epoch ", target_.at.epoch, " is collected: the oldest one kept is ", (*oldest)->value));
  }

  /// Takes the values that are reached again out of the rows that name them for collection.
  absl::Status Revive(const std::vector<ValueName>& values) {
    const absl::flat_hash_set<ValueName> revived(values.begin(), values.end());
    absl::Status broken;
    const absl::Status scanned =
        engine_.Scan(partition_, SupersededRow(target_.at.epoch + 1), SupersededRow(head_.at.epoch + 1),
                     [&](std::string_view key, std::string_view bytes) {
                       absl::StatusOr<Superseded> row = DecodeSuperseded(bytes);
                       if (!row.ok()) {
                         broken = row.status();
                         return false;
                       }
                       const size_t before = row->names.size();
                       std::erase_if(row->names, [&](const ValueName& name) { return revived.contains(name); });
                       if (row->names.size() == before) return true;
                       conditions.push_back({std::string(key), std::string(bytes)});
                       std::optional<std::string> left;
                       if (!row->names.empty()) left = EncodeRow(*row);
                       mutations.push_back({std::string(key), std::move(left)});
                       return true;
                     });
    return scanned.ok() ? broken : scanned;
  }

  /// Sessions that came since are no longer applied; those that the old state had and the head has not are again.
  absl::Status MoveSessions(uint64_t epoch) {
    const absl::StatusOr<HistoryDifference> history =
        CompareHistories(engine_, head_.map.incarnation, head_.at.epoch, target_.at.epoch);
    if (!history.ok()) return history.status();
    std::set<std::string> revived;
    for (const CommitRecord& commit : history->only_b) {
      revived.insert(commit.session);
      mutations.push_back({AppliedRowKey(commit.session), EncodeRow(Applied{commit.epoch, AttemptOf(commit)})});
      mutations.push_back({WithdrawnRowKey(commit.session, AttemptOf(commit)), std::nullopt});
      mutations.push_back({UnsettledRow(commit.session), EncodeRow(Random64())});
    }
    for (const CommitRecord& commit : history->only_a) {
      mutations.push_back(
          {WithdrawnRowKey(commit.session, AttemptOf(commit)), EncodeRow(Withdrawn{commit.epoch, epoch})});
      if (revived.contains(commit.session)) continue;
      mutations.push_back({AppliedRowKey(commit.session), std::nullopt});
      mutations.push_back({UnsettledRow(commit.session), EncodeRow(Random64())});
      outcome.withdrawn.push_back(commit.session);
    }
    outcome.revived.assign(revived.begin(), revived.end());
    std::ranges::sort(outcome.withdrawn);
    return absl::OkStatus();
  }

  const Snapshot::State& head_;
  const Snapshot::State& target_;
  const Engine& engine_;
  const std::string partition_;
};

/// Whether an earlier try, whose answer did not come, made the head's epoch or one before it.
absl::StatusOr<bool> WasApplied(const Engine& engine, uint64_t incarnation, const RollbackOutcome& tried) {
  const auto commit = ReadRow(engine, HeadPartition(incarnation), CommitRowKey(tried.commit.epoch), DecodeCommit);
  if (!commit.ok()) return commit.status();
  return *commit && (*commit)->value.attempt == tried.commit.attempt;
}

}  // namespace

absl::StatusOr<RollbackOutcome> RollBackTo(MapStore::State& store, std::string_view map, uint64_t epoch) {
  const uint64_t attempt = Random64();
  std::vector<RollbackOutcome> unanswered;
  absl::Status last;
  for (int i = 0; i < kTries; ++i) {
    if (i > 0) std::this_thread::sleep_for(kPause * std::min(i, 20));
    const auto target = OpenState(store, map, epoch);
    if (!target.ok()) return target.status();
    const auto head = OpenState(store, map, std::nullopt);
    if (!head.ok()) return head.status();
    const uint64_t incarnation = (*head)->map.incarnation;
    if ((*target)->map.incarnation != incarnation) return absl::AbortedError(Text("map ", map, " was made again"));
    // Each try requires another head or the same one: no two of them can be applied.
    for (const RollbackOutcome& tried : unanswered) {
      const absl::StatusOr<bool> applied = WasApplied(store.engine, incarnation, tried);
      if (!applied.ok()) return applied.status();
      if (*applied) return tried;
    }
    RollbackPlan plan(**head, **target, store.engine);
    if (absl::Status status = plan.Make(attempt, store.options.now()); !status.ok()) return status;
    last = store.engine.CompareAndSet(HeadPartition(incarnation), plan.conditions, plan.mutations);
    if (last.ok()) return std::move(plan.outcome);
    const bool open = absl::IsUnknown(last) || absl::IsDeadlineExceeded(last);
    if (!open && !absl::IsAborted(last)) return last;
    if (open) unanswered.push_back(std::move(plan.outcome));
  }
  return last;
}

}  // namespace mapkeep
