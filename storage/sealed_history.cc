#include "storage/sealed_history.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "storage/map_rows.h"
#include "storage/record_codec.h"
#include "storage/records.pb.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

/// The encoded records of one segment.
struct Segment {
  uint64_t incarnation = 0, first = 0;
  std::vector<std::string> rows;
};

absl::StatusOr<Segment> ReadSegment(const Engine& engine, uint64_t incarnation, uint64_t first) {
  const auto damaged = [first](std::string_view why) {
    return absl::DataLossError(Text("the records of the commits from epoch ", first, " on ", why));
  };
  const absl::StatusOr<std::string> value = engine.GetValue(HistoryGroup(incarnation), SegmentKey(first));
  if (absl::IsNotFound(value.status())) return damaged("are missing");
  if (!value.ok()) return value.status();
  absl::StatusOr<storage::HistorySegment> segment =
      DecodeRecord<storage::HistorySegment>(*value, Text("history segment of epoch ", first));
  if (!segment.ok()) return segment.status();
  if (segment->first() != first || segment->rows_size() != kSegmentEpochs) return damaged("are other ones");
  Segment read{incarnation, first, {}};
  for (std::string& row : *segment->mutable_rows()) read.rows.push_back(std::move(row));
  return read;
}

absl::StatusOr<CommitRecord> ReadSealed(const Engine& engine, uint64_t incarnation, uint64_t epoch) {
  // Histories are read one epoch after the other; segments never change.
  thread_local Segment last;
  const uint64_t first = (epoch - 1) / kSegmentEpochs * kSegmentEpochs + 1;
  if (last.incarnation != incarnation || last.first != first || last.rows.empty()) {
    absl::StatusOr<Segment> read = ReadSegment(engine, incarnation, first);
    if (!read.ok()) return read.status();
    last = *std::move(read);
  }
  return DecodeCommit(last.rows[epoch - first]);
}

/// Seals the next segment, if its records are all rows. False if somebody else was faster.
absl::StatusOr<bool> SealNext(Engine& engine, uint64_t incarnation, uint64_t sealed) {
  const std::string partition = HeadPartition(incarnation);
  storage::HistorySegment segment;
  segment.set_first(sealed + 1);
  std::vector<Mutation> mutations = {{std::string(kSealedRow), EncodeRow(sealed + kSegmentEpochs)}};
  absl::Status scanned = engine.Scan(partition, CommitRowKey(sealed + 1), CommitRowKey(sealed + kSegmentEpochs + 1),
                                     [&](std::string_view key, std::string_view row) {
                                       segment.add_rows(std::string(row));
                                       mutations.push_back({std::string(key), std::nullopt});
                                       return true;
                                     });
  if (!scanned.ok()) return scanned;
  if (segment.rows_size() != kSegmentEpochs) return false;
  const ImmutableValue value{SegmentKey(sealed + 1), EncodeRecord(segment)};
  if (absl::Status status = engine.PutValues(HistoryGroup(incarnation), {&value, 1}); !status.ok()) return status;
  const std::optional<std::string> before = sealed == 0 ? std::nullopt : std::optional(EncodeRow(sealed));
  const absl::StatusOr<std::optional<std::string>> alive = engine.Get(partition, kMapRow);
  if (!alive.ok()) return alive.status();
  if (!*alive) return false;
  const std::vector<Condition> conditions = {{std::string(kMapRow), *alive}, {std::string(kSealedRow), before}};
  const absl::Status moved = engine.CompareAndSet(partition, conditions, mutations);
  if (absl::IsAborted(moved)) return false;
  if (!moved.ok()) return moved;
  return true;
}

}  // namespace

std::string HistoryGroup(uint64_t incarnation) { return Text("map/", Hex(incarnation), "/history"); }
std::string SegmentKey(uint64_t first_epoch) { return Hex(first_epoch); }

absl::StatusOr<uint64_t> SealedEpochs(const Engine& engine, uint64_t incarnation) {
  const auto sealed = ReadRow(engine, HeadPartition(incarnation), kSealedRow, DecodeNumber);
  if (!sealed.ok()) return sealed.status();
  return *sealed ? (*sealed)->value : 0;
}

absl::StatusOr<std::optional<CommitRecord>> FindCommitRecord(const Engine& engine, uint64_t incarnation,
                                                             uint64_t epoch) {
  auto row = ReadRow(engine, HeadPartition(incarnation), CommitRowKey(epoch), DecodeCommit);
  if (!row.ok()) return row.status();
  if (*row) return std::optional(std::move((*row)->value));
  const absl::StatusOr<uint64_t> sealed = SealedEpochs(engine, incarnation);
  if (!sealed.ok()) return sealed.status();
  if (epoch == 0 || epoch > *sealed) return std::nullopt;
  absl::StatusOr<CommitRecord> found = ReadSealed(engine, incarnation, epoch);
  if (!found.ok()) return found.status();
  return std::optional(*std::move(found));
}

absl::Status ForEachCommit(const Engine& engine, uint64_t incarnation,
                           const std::function<absl::Status(const CommitRecord&)>& visit) {
  const std::string partition = HeadPartition(incarnation);
  const auto head = ReadRow(engine, partition, kHeadRow, DecodeEpoch);
  if (!head.ok()) return head.status();
  const uint64_t newest = *head ? (*head)->value.epoch : 0;
  const absl::StatusOr<uint64_t> sealed = SealedEpochs(engine, incarnation);
  if (!sealed.ok()) return sealed.status();
  uint64_t next = 1;
  for (; next <= std::min(*sealed, newest); ++next) {
    const absl::StatusOr<CommitRecord> commit = ReadSealed(engine, incarnation, next);
    if (!commit.ok()) return commit.status();
    if (absl::Status status = visit(*commit); !status.ok()) return status;
  }
  absl::Status visited;
  const absl::Status scanned =
      engine.Scan(partition, CommitRowKey(next), CommitRowKey(newest + 1), [&](std::string_view, std::string_view row) {
        const absl::StatusOr<CommitRecord> commit = DecodeCommit(row);
        visited = commit.status();
        // A gap: sealed under the scan.
        if (!visited.ok() || commit->epoch != next) return false;
        ++next;
        visited = visit(*commit);
        return visited.ok();
      });
  if (!scanned.ok()) return scanned;
  for (; visited.ok() && next <= newest; ++next) {
    const absl::StatusOr<std::optional<CommitRecord>> commit = FindCommitRecord(engine, incarnation, next);
    if (!commit.ok()) return commit.status();
    if (!*commit) return absl::DataLossError(Text("the record of the commit of epoch ", next, " is missing"));
    visited = visit(**commit);
  }
  return visited;
}

absl::Status SealHistory(Engine& engine, uint64_t incarnation, uint64_t keep_rows) {
  const auto head = ReadRow(engine, HeadPartition(incarnation), kHeadRow, DecodeEpoch);
  if (!head.ok()) return head.status();
  if (!*head) return absl::OkStatus();  // being deleted
  absl::StatusOr<uint64_t> sealed = SealedEpochs(engine, incarnation);
  while (sealed.ok() && (*head)->value.epoch >= *sealed + kSegmentEpochs + keep_rows) {
    const absl::StatusOr<bool> moved = SealNext(engine, incarnation, *sealed);
    if (!moved.ok()) return moved.status();
    if (!*moved) return absl::OkStatus();
    *sealed += kSegmentEpochs;
  }
  return sealed.status();
}

}  // namespace mapkeep
