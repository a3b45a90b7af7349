#include "storage/map_rows.h"

#include <absl/strings/numbers.h>

#include <algorithm>
#include <random>

#include "storage/record_codec.h"
#include "storage/records.pb.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

void CopyTo(const Eigen::Vector3d& from, storage::Vector& to) {
  to.set_x(from.x());
  to.set_y(from.y());
  to.set_z(from.z());
}

Eigen::Vector3d VectorOf(const storage::Vector& from) { return {from.x(), from.y(), from.z()}; }

void CopyTo(const std::vector<ValueName>& from, storage::ValueNames& to) {
  for (const ValueName& name : from) {
    to.add_kinds(static_cast<uint32_t>(name.kind));
    to.add_places(name.place);
    to.add_attempts(name.written.attempt);
    to.add_rounds(name.written.round);
  }
}

absl::StatusOr<std::vector<ValueName>> NamesOf(const storage::ValueNames& from) {
  const int count = from.kinds_size();
  if (from.places_size() != count || from.attempts_size() != count || from.rounds_size() != count) {
    return absl::DataLossError("value names: the columns differ in length");
  }
  std::vector<ValueName> names;
  names.reserve(count);
  for (int i = 0; i < count; ++i) {
    names.push_back({static_cast<ValueKind>(from.kinds(i)), from.places(i), {from.attempts(i), from.rounds(i)}});
  }
  return names;
}

}  // namespace

std::string EncodeRow(const MapRecord& map) {
  storage::MapRow row;
  row.set_name(map.name);
  row.set_incarnation(map.incarnation);
  row.set_voxel_size(map.voxel_size);
  if (map.origin) CopyTo(*map.origin, *row.mutable_origin());
  row.set_crs(map.crs);
  row.set_created(map.created);
  return EncodeRecord(row);
}

absl::StatusOr<MapRecord> DecodeMap(std::string_view bytes) {
  const absl::StatusOr<storage::MapRow> row = DecodeRecord<storage::MapRow>(bytes, "map row");
  if (!row.ok()) return row.status();
  MapRecord map{row->name(), row->incarnation(), row->voxel_size(), std::nullopt, row->crs(), row->created()};
  if (row->has_origin()) map.origin = VectorOf(row->origin());
  return map;
}

std::string EncodeRow(const EpochState& state) {
  storage::EpochRow row;
  row.set_epoch(state.epoch);
  row.set_sessions(state.sessions);
  row.set_rollback(state.rollback);
  if (state.origin) CopyTo(*state.origin, *row.mutable_origin());
  row.set_has_root(state.root.has_value());
  if (state.root) {
    row.set_attempt(state.root->written.attempt);
    row.set_round(state.root->written.round);
    const MapTotals& totals = state.root->totals;
    row.mutable_totals()->set_voxels(totals.voxels);
    row.mutable_totals()->set_static_voxels(totals.static_voxels);
    row.mutable_totals()->set_blocks(totals.blocks);
    row.mutable_totals()->set_tiles(totals.tiles);
    for (const VoxelIndex& corner : {state.root->bounds.first, state.root->bounds.last}) {
      for (const int32_t coordinate : {corner.x, corner.y, corner.z}) row.mutable_bounds()->add_corners(coordinate);
    }
  }
  return EncodeRecord(row);
}

absl::StatusOr<EpochState> DecodeEpoch(std::string_view bytes) {
  const absl::StatusOr<storage::EpochRow> row = DecodeRecord<storage::EpochRow>(bytes, "epoch row");
  if (!row.ok()) return row.status();
  EpochState state{row->epoch(), row->sessions(), std::nullopt, std::nullopt, row->rollback()};
  if (row->has_origin()) state.origin = VectorOf(row->origin());
  if (!row->has_root()) return state;
  if (row->bounds().corners_size() != 6) return absl::DataLossError("epoch row: its bounds are not six numbers");
  const storage::Totals& totals = row->totals();
  const auto corner = [&row](int i) { return row->bounds().corners(i); };
  state.root = TreeChild{0,
                         {row->attempt(), row->round()},
                         {totals.voxels(), totals.static_voxels(), totals.blocks(), totals.tiles()},
                         {{corner(0), corner(1), corner(2)}, {corner(3), corner(4), corner(5)}}};
  return state;
}

std::string EncodeRow(const Intent& intent) {
  storage::IntentRow row;
  row.set_session(intent.session);
  row.set_attempt(intent.attempt);
  row.set_nonce(intent.nonce);
  row.set_fence(intent.fence);
  row.set_expires(intent.expires);
  return EncodeRecord(row);
}

absl::StatusOr<Intent> DecodeIntent(std::string_view bytes) {
  const absl::StatusOr<storage::IntentRow> row = DecodeRecord<storage::IntentRow>(bytes, "intent row");
  if (!row.ok()) return row.status();
  return Intent{row->session(), row->attempt(), row->nonce(), row->fence(), row->expires()};
}

std::string EncodeRow(const Applied& applied) {
  storage::AppliedRow row;
  row.set_epoch(applied.epoch);
  row.set_attempt(applied.attempt);
  return EncodeRecord(row);
}

absl::StatusOr<Applied> DecodeApplied(std::string_view bytes) {
  const absl::StatusOr<storage::AppliedRow> row = DecodeRecord<storage::AppliedRow>(bytes, "applied row");
  if (!row.ok()) return row.status();
  return Applied{row->epoch(), row->attempt()};
}

std::string EncodeRow(const Staged& staged) {
  storage::StagedRow row;
  row.set_session(staged.session);
  row.set_attempt(staged.attempt);
  CopyTo(staged.values, *row.mutable_values());
  return EncodeRecord(row);
}

absl::StatusOr<Staged> DecodeStaged(std::string_view bytes) {
  const absl::StatusOr<storage::StagedRow> row = DecodeRecord<storage::StagedRow>(bytes, "staged row");
  if (!row.ok()) return row.status();
  absl::StatusOr<std::vector<ValueName>> values = NamesOf(row->values());
  if (!values.ok()) return values.status();
  return Staged{row->session(), row->attempt(), *std::move(values)};
}

std::string EncodeRow(const PurgeOrder& order) {
  storage::PurgeRow row;
  row.set_incarnation(order.incarnation);
  row.set_after(order.after);
  row.set_begun(order.begun);
  return EncodeRecord(row);
}

absl::StatusOr<PurgeOrder> DecodePurge(std::string_view bytes) {
  const absl::StatusOr<storage::PurgeRow> row = DecodeRecord<storage::PurgeRow>(bytes, "purge row");
  if (!row.ok()) return row.status();
  return PurgeOrder{row->incarnation(), row->after(), row->begun()};
}

std::string EncodeRow(const Pin& pin) {
  storage::PinRow row;
  row.set_epoch(pin.epoch);
  row.set_expires(pin.expires);
  return EncodeRecord(row);
}

absl::StatusOr<Pin> DecodePin(std::string_view bytes) {
  const absl::StatusOr<storage::PinRow> row = DecodeRecord<storage::PinRow>(bytes, "pin row");
  if (!row.ok()) return row.status();
  return Pin{row->epoch(), row->expires()};
}

std::string EncodeRow(const LeaseEntry& lease) {
  storage::LeaseRow row;
  row.set_holder(lease.holder);
  row.set_fence(lease.fence);
  row.set_expires(lease.expires);
  return EncodeRecord(row);
}

absl::StatusOr<LeaseEntry> DecodeLease(std::string_view bytes) {
  const absl::StatusOr<storage::LeaseRow> row = DecodeRecord<storage::LeaseRow>(bytes, "lease row");
  if (!row.ok()) return row.status();
  return LeaseEntry{row->holder(), row->fence(), row->expires()};
}

std::string EncodeRow(const CommitRecord& commit) {
  storage::CommitRow row;
  row.set_epoch(commit.epoch);
  row.set_session(commit.session);
  row.set_base_epoch(commit.base_epoch);
  row.set_attempt(AttemptOf(commit));
  row.set_time(commit.time);
  for (const TileKey tile : commit.touched_tiles) row.add_touched_tiles(static_cast<uint32_t>(tile));
  row.set_rollback(commit.rollback);
  row.set_rollback_before(commit.rollback_before);
  return EncodeRecord(row);
}

absl::StatusOr<CommitRecord> DecodeCommit(std::string_view bytes) {
  const absl::StatusOr<storage::CommitRow> row = DecodeRecord<storage::CommitRow>(bytes, "commit row");
  if (!row.ok()) return row.status();
  CommitRecord commit{
      row->epoch(), row->session(), row->base_epoch(), AttemptName(row->session(), row->attempt()), row->time(), {}};
  for (const uint32_t tile : row->touched_tiles()) commit.touched_tiles.push_back(TileKey{tile});
  commit.rollback = row->rollback();
  commit.rollback_before = row->rollback_before();
  return commit;
}

std::string EncodeRow(const Superseded& superseded) {
  storage::ValueNames row;
  CopyTo(superseded.names, row);
  for (const uint64_t epoch : superseded.needed_by) row.add_needed_by(epoch);
  return EncodeRecord(row);
}

absl::StatusOr<Superseded> DecodeSuperseded(std::string_view bytes) {
  const absl::StatusOr<storage::ValueNames> row = DecodeRecord<storage::ValueNames>(bytes, "superseded row");
  if (!row.ok()) return row.status();
  absl::StatusOr<std::vector<ValueName>> names = NamesOf(*row);
  if (!names.ok()) return names.status();
  return Superseded{*std::move(names), {row->needed_by().begin(), row->needed_by().end()}};
}

std::string EncodeRow(const Tags& tags) {
  storage::TagsRow row;
  for (const Tag& tag : tags.tags) {
    row.add_names(tag.name);
    row.add_epochs(tag.epoch);
    row.add_times(tag.time);
  }
  return EncodeRecord(row);
}

absl::StatusOr<Tags> DecodeTags(std::string_view bytes) {
  const absl::StatusOr<storage::TagsRow> row = DecodeRecord<storage::TagsRow>(bytes, "tags row");
  if (!row.ok()) return row.status();
  if (row->epochs_size() != row->names_size() || row->times_size() != row->names_size()) {
    return absl::DataLossError("tags row: the columns differ in length");
  }
  Tags tags;
  for (int i = 0; i < row->names_size(); ++i) tags.tags.push_back({row->names(i), row->epochs(i), row->times(i)});
  return tags;
}

std::string EncodeRow(const Withdrawn& withdrawn) {
  storage::WithdrawnRow row;
  row.set_epoch(withdrawn.epoch);
  row.set_rollback(withdrawn.rollback);
  return EncodeRecord(row);
}

absl::StatusOr<Withdrawn> DecodeWithdrawn(std::string_view bytes) {
  const absl::StatusOr<storage::WithdrawnRow> row = DecodeRecord<storage::WithdrawnRow>(bytes, "withdrawn row");
  if (!row.ok()) return row.status();
  return Withdrawn{row->epoch(), row->rollback()};
}

std::string EncodeRow(uint64_t number) { return Hex(number); }

absl::StatusOr<uint64_t> DecodeNumber(std::string_view bytes) {
  uint64_t number = 0;
  if (bytes.size() == 16 && absl::SimpleHexAtoi(ToAbsl(bytes), &number)) return number;
  return absl::DataLossError("counter row: it is not 16 hexadecimal digits");
}

bool IsTagged(const Tags& tags, uint64_t epoch) {
  return std::ranges::any_of(tags.tags, [epoch](const Tag& tag) { return tag.epoch == epoch; });
}

std::string AttemptName(std::string_view session, uint64_t attempt) { return Text(session, "/", Hex(attempt)); }

uint64_t AttemptOf(const CommitRecord& commit) {
  uint64_t attempt = 0;
  const size_t slash = commit.attempt.rfind('/');
  if (slash == std::string::npos || !absl::SimpleHexAtoi(commit.attempt.substr(slash + 1), &attempt)) return 0;
  return attempt;
}

uint64_t Random64() {
  thread_local std::random_device random;
  return uint64_t{random()} << 32 | random();
}

absl::StatusOr<uint64_t> FindIncarnation(const Engine& engine, std::string_view map) {
  const auto row = ReadRow(engine, kCatalogue, CatalogueRow(map), DecodeMap);
  if (!row.ok()) return row.status();
  if (!*row) return absl::NotFoundError(Text("there is no map ", map));
  return (*row)->value.incarnation;
}

}  // namespace mapkeep
