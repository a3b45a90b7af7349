#include "storage/map_history.h"

#include <algorithm>

#include "storage/map_store_state.h"
#include "storage/sealed_history.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

uint64_t ParentOf(const CommitRecord& commit) { return commit.rollback ? commit.base_epoch : commit.epoch - 1; }

absl::StatusOr<MapVersion> ReadVersion(const Engine& engine, uint64_t incarnation, uint64_t epoch, double created,
                                       uint64_t oldest, const Tags& tags) {
  MapVersion version{.commit = {.epoch = 0, .time = created}};
  if (epoch > 0) {
    absl::StatusOr<CommitRecord> commit = ReadCommit(engine, incarnation, epoch);
    if (!commit.ok()) return commit.status();
    version.commit = *std::move(commit);
  }
  for (const Tag& tag : tags.tags) {
    if (tag.epoch == epoch) version.tags.push_back(tag.name);
  }
  if (epoch < oldest && version.tags.empty()) return version;
  const auto root = ReadRow(engine, HeadPartition(incarnation), RootRow(epoch), DecodeEpoch);
  if (!root.ok()) return root.status();
  if (!*root) return version;  // collected this moment
  version.readable = true;
  version.sessions = (*root)->value.sessions;
  version.totals = (*root)->value.root ? (*root)->value.root->totals : MapTotals();
  return version;
}

}  // namespace

absl::StatusOr<CommitRecord> ReadCommit(const Engine& engine, uint64_t incarnation, uint64_t epoch) {
  absl::StatusOr<std::optional<CommitRecord>> commit = FindCommitRecord(engine, incarnation, epoch);
  if (!commit.ok()) return commit.status();
  if (!*commit) return absl::DataLossError(Text("the record of the commit of epoch ", epoch, " is missing"));
  return **std::move(commit);
}

absl::StatusOr<bool> IsAncestor(const Engine& engine, uint64_t incarnation, uint64_t epoch, const EpochState& state) {
  uint64_t at = state.epoch;
  uint64_t rollback = state.rollback;
  // From the newest rollback on, one epoch follows the other; before it, its base does.
  while (epoch <= at && epoch < rollback) {
    const absl::StatusOr<CommitRecord> commit = ReadCommit(engine, incarnation, rollback);
    if (!commit.ok()) return commit.status();
    at = commit->base_epoch;
    rollback = commit->rollback_before;
  }
  return epoch <= at;
}

absl::StatusOr<HistoryDifference> CompareHistories(const Engine& engine, uint64_t incarnation, uint64_t a, uint64_t b) {
  HistoryDifference difference;
  while (a != b) {
    uint64_t& higher = a > b ? a : b;  // a parent is always lower
    absl::StatusOr<CommitRecord> commit = ReadCommit(engine, incarnation, higher);
    if (!commit.ok()) return commit.status();
    std::vector<CommitRecord>& side = a > b ? difference.only_a : difference.only_b;
    higher = ParentOf(*commit);
    if (!commit->rollback) side.push_back(*std::move(commit));
  }
  return difference;
}

absl::StatusOr<MapHead> MapStore::Head(std::string_view map) const {
  const absl::StatusOr<MapRecord> record = Find(map);
  if (!record.ok()) return record.status();
  const auto head = ReadRow(state_->engine, HeadPartition(record->incarnation), kHeadRow, DecodeEpoch);
  if (!head.ok()) return head.status();
  if (!*head) return absl::NotFoundError(Text("map ", map, " is being deleted"));
  return MapHead{record->incarnation, (*head)->value.epoch};
}

absl::StatusOr<std::vector<CommitRecord>> MapStore::CommitsAfter(std::string_view map, const MapHead& after,
                                                                 size_t limit) const {
  const absl::StatusOr<MapHead> head = Head(map);
  if (!head.ok()) return head.status();
  if (head->incarnation != after.incarnation) return absl::NotFoundError(Text("map ", map, " was made anew"));
  std::vector<CommitRecord> commits;
  for (uint64_t epoch = after.epoch + 1; epoch <= head->epoch && commits.size() < limit; ++epoch) {
    absl::StatusOr<CommitRecord> commit = ReadCommit(state_->engine, after.incarnation, epoch);
    if (!commit.ok()) return commit.status();
    commits.push_back(*std::move(commit));
  }
  return commits;
}

absl::StatusOr<std::vector<MapVersion>> MapStore::Versions(std::string_view map, std::optional<uint64_t> newest,
                                                           size_t limit) const {
  const Engine& engine = state_->engine;
  const absl::StatusOr<MapRecord> record = Find(map);
  if (!record.ok()) return record.status();
  const std::string partition = HeadPartition(record->incarnation);
  const auto head = ReadRow(engine, partition, kHeadRow, DecodeEpoch);
  if (!head.ok()) return head.status();
  if (!*head) return absl::NotFoundError(Text("map ", map, " is being deleted"));
  const auto oldest = ReadRow(engine, partition, kOldestRow, DecodeNumber);
  if (!oldest.ok()) return oldest.status();
  const absl::StatusOr<mapkeep::Tags> tags = ReadTags(engine, record->incarnation);
  if (!tags.ok()) return tags.status();
  std::vector<MapVersion> versions;
  uint64_t epoch = std::min(newest.value_or((*head)->value.epoch), (*head)->value.epoch);
  for (size_t i = 0; i < limit; ++i, --epoch) {
    absl::StatusOr<MapVersion> version =
        ReadVersion(engine, record->incarnation, epoch, record->created, *oldest ? (*oldest)->value : 0, *tags);
    if (!version.ok()) return version.status();
    versions.push_back(*std::move(version));
    if (epoch == 0) break;
  }
  return versions;
}

}  // namespace mapkeep
