#include "storage/leases.h"

#include <utility>
#include <vector>

#include "storage/map_rows.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr int kTries = 64;

absl::Status TakenOver(const Lease& lease) {
  return absl::AbortedError(
      Text("the lease of ", lease.holder, " on session ", lease.session, " was taken over or released"));
}

/// The lease's row if it is still the same holder's under the same fence; ABORTED otherwise.
absl::StatusOr<StoredRow<LeaseEntry>> FindOwn(const Engine& engine, const std::string& partition, const Lease& lease) {
  auto row = ReadRow(engine, partition, LeaseRowKey(lease.session), DecodeLease);
  if (!row.ok()) return row.status();
  if (!*row || (*row)->value.fence != lease.fence) return TakenOver(lease);
  return **std::move(row);
}

}  // namespace

std::unique_ptr<Leases> OpenLeases(Engine& engine, Clock now) {
  return std::make_unique<Leases>(engine, std::move(now));
}

Leases::Leases(Engine& engine, Clock now) : engine_(engine), now_(std::move(now)) {}

absl::StatusOr<Lease> Leases::Acquire(std::string_view map, std::string_view session, std::string_view holder,
                                      double seconds) {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(engine_, map);
  if (!incarnation.ok()) return incarnation.status();
  const std::string partition = HeadPartition(*incarnation);
  absl::Status last;
  for (int i = 0; i < kTries; ++i) {
    const absl::StatusOr<std::optional<std::string>> alive = engine_.Get(partition, kMapRow);
    if (!alive.ok()) return alive.status();
    if (!*alive) return absl::NotFoundError(Text("map ", map, " is deleted"));
    const auto held = ReadRow(engine_, partition, LeaseRowKey(session), DecodeLease);
    if (!held.ok()) return held.status();
    const double now = now_();
    if (*held && (*held)->value.holder != holder && (*held)->value.expires > now) {
      return absl::AbortedError(Text("session ", session, " is leased to ", (*held)->value.holder));
    }
    const auto newest = ReadRow(engine_, partition, kFenceRow, DecodeNumber);
    if (!newest.ok()) return newest.status();
    // The fence counts for the whole map and is never lowered, so that a released lease's fence does not come back.
    const LeaseEntry entry{std::string(holder), (*newest ? (*newest)->value : 0) + 1, now + seconds};
    const std::vector<Condition> conditions = {{std::string(kMapRow), *alive},
                                               {LeaseRowKey(session), BytesOf(*held)},
                                               {std::string(kFenceRow), BytesOf(*newest)}};
    const std::vector<Mutation> mutations = {{LeaseRowKey(session), EncodeRow(entry)},
                                             {SessionFenceRow(session), EncodeRow(entry.fence)},
                                             {std::string(kFenceRow), EncodeRow(entry.fence)}};
    last = engine_.CompareAndSet(partition, conditions, mutations);
    if (last.ok()) {
      return Lease{std::string(map), std::string(session), entry.holder, entry.fence, entry.expires};
    }
    // Applied or not, the next turn sees it: one holder may take over its own lease.
    if (!absl::IsAborted(last) && !absl::IsUnknown(last) && !absl::IsDeadlineExceeded(last)) return last;
  }
  return last;
}

absl::StatusOr<Lease> Leases::Renew(const Lease& lease, double seconds) {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(engine_, lease.map);
  if (absl::IsNotFound(incarnation.status())) return TakenOver(lease);
  if (!incarnation.ok()) return incarnation.status();
  const std::string partition = HeadPartition(*incarnation);
  absl::StatusOr<StoredRow<LeaseEntry>> row = FindOwn(engine_, partition, lease);
  if (!row.ok()) return row.status();
  Lease renewed = lease;
  renewed.expires = row->value.expires = now_() + seconds;
  const std::vector<Condition> conditions = {{LeaseRowKey(lease.session), row->bytes}};
  const std::vector<Mutation> mutations = {{LeaseRowKey(lease.session), EncodeRow(row->value)}};
  const absl::Status written = engine_.CompareAndSet(partition, conditions, mutations);
  if (absl::IsAborted(written)) return TakenOver(lease);
  if (!written.ok()) return written;
  return renewed;
}

absl::Status Leases::Release(const Lease& lease) {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(engine_, lease.map);
  if (absl::IsNotFound(incarnation.status())) return absl::OkStatus();
  if (!incarnation.ok()) return incarnation.status();
  const std::string partition = HeadPartition(*incarnation);
  const absl::StatusOr<StoredRow<LeaseEntry>> row = FindOwn(engine_, partition, lease);
  if (absl::IsAborted(row.status())) return absl::OkStatus();
  if (!row.ok()) return row.status();
  const std::vector<Condition> conditions = {{LeaseRowKey(lease.session), row->bytes}};
  const std::vector<Mutation> mutations = {{LeaseRowKey(lease.session), std::nullopt},
                                           {SessionFenceRow(lease.session), std::nullopt}};
  const absl::Status written = engine_.CompareAndSet(partition, conditions, mutations);
  return absl::IsAborted(written) ? absl::OkStatus() : written;
}

}  // namespace mapkeep
