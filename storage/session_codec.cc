#include "storage/session_codec.h"

#include <algorithm>

#include "storage/record_codec.h"
#include "storage/records.pb.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

void CopyTo(const SessionReport& from, storage::SessionReport& to) {
  for (const WindowResult& window : from.windows) {
    storage::Window& added = *to.add_windows();
    added.set_first_scan(window.first_scan);
    added.set_last_scan(window.last_scan);
    added.set_fitness(window.fitness);
    added.set_inliers(window.inliers);
    added.set_correction(window.correction);
    added.set_rotation(window.rotation);
    added.set_observability(window.observability);
    added.set_trusted(window.trusted);
    added.set_precision(window.precision);
    added.set_coverage(window.coverage);
  }
  for (const StageTime& stage : from.stages) {
    storage::StageTime& added = *to.add_stages();
    added.set_stage(stage.stage);
    added.set_seconds(stage.seconds);
  }
  to.set_points(from.points);
  to.set_points_removed(from.points_removed);
  to.set_points_restored(from.points_restored);
  to.set_session_voxels(from.session_voxels);
  to.set_voxels_kept(from.voxels_kept);
  to.set_static_voxels(from.static_voxels);
  to.set_blocks_touched(from.blocks_touched);
  to.set_base_epoch(from.base_epoch);
  to.set_epoch(from.epoch);
}

SessionReport ReportOf(const storage::SessionReport& from) {
  SessionReport report;
  for (const storage::Window& window : from.windows()) {
    report.windows.push_back({window.first_scan(), window.last_scan(), window.fitness(), window.inliers(),
                              window.correction(), window.rotation(), window.observability(), window.trusted(),
                              window.precision(), window.coverage()});
  }
  for (const storage::StageTime& stage : from.stages()) report.stages.push_back({stage.stage(), stage.seconds()});
  report.points = from.points();
  report.points_removed = from.points_removed();
  report.points_restored = from.points_restored();
  report.session_voxels = from.session_voxels();
  report.voxels_kept = from.voxels_kept();
  report.static_voxels = from.static_voxels();
  report.blocks_touched = from.blocks_touched();
  report.base_epoch = from.base_epoch();
  report.epoch = from.epoch();
  return report;
}

}  // namespace

std::string EncodeSession(const StoredSession& session) {
  const SessionRecord& record = session.record;
  storage::SessionRow row;
  row.set_id(record.id);
  row.set_incarnation(session.incarnation);
  row.set_robot(record.robot);
  row.set_state(static_cast<uint32_t>(record.state));
  row.set_keep_scans(record.keep_scans);
  row.set_scan_count(session.scan_count);
  row.set_durable_scans(record.durable_scans);
  row.set_scans_deleted(record.scans_deleted);
  row.set_created(record.created);
  row.set_ended(record.ended);
  row.set_start_time(record.start_time);
  row.set_reason(record.reason);
  CopyTo(record.report, *row.mutable_report());
  row.set_poses(session.poses);
  row.set_pose_count(session.pose_count);
  row.set_revision(session.revision);
  if (record.initial_pose) row.mutable_initial_pose()->Add(record.initial_pose->begin(), record.initial_pose->end());
  if (record.gnss) row.mutable_gnss()->Add(record.gnss->begin(), record.gnss->end());
  row.set_lacks_map(record.lacks_map);
  row.set_retries(record.retries);
  row.set_staged_bytes(record.staged_bytes);
  row.set_payload_bytes(record.payload_bytes);
  row.set_turn(record.turn);
  return EncodeRecord(row);
}

absl::StatusOr<StoredSession> DecodeSession(std::string_view bytes) {
  const absl::StatusOr<storage::SessionRow> row = DecodeRecord<storage::SessionRow>(bytes, "session row");
  if (!row.ok()) return row.status();
  if (row->state() < static_cast<uint32_t>(SessionState::kUploading) ||
      row->state() > static_cast<uint32_t>(SessionState::kRolledBack)) {
    return absl::DataLossError(Text("session row: unknown state ", row->state()));
  }
  StoredSession session;
  SessionRecord& record = session.record;
  record.id = row->id();
  record.robot = row->robot();
  record.state = static_cast<SessionState>(row->state());
  record.keep_scans = row->keep_scans();
  record.durable_scans = row->durable_scans();
  record.scans_deleted = row->scans_deleted();
  record.created = row->created();
  record.ended = row->ended();
  record.start_time = row->start_time();
  record.reason = row->reason();
  record.report = ReportOf(row->report());
  session.incarnation = row->incarnation();
  session.scan_count = row->scan_count();
  session.poses = row->poses();
  session.pose_count = row->pose_count();
  session.revision = row->revision();
  if (row->initial_pose_size() == 4) {
    record.initial_pose.emplace();
    std::copy(row->initial_pose().begin(), row->initial_pose().end(), record.initial_pose->begin());
  }
  if (row->gnss_size() == 12) {
    record.gnss.emplace();
    std::copy(row->gnss().begin(), row->gnss().end(), record.gnss->begin());
  }
  record.lacks_map = row->lacks_map();
  record.retries = row->retries();
  record.staged_bytes = row->staged_bytes();
  record.payload_bytes = row->payload_bytes();
  record.turn = row->turn();
  return session;
}

std::string EncodeContent(std::span<const uint32_t> scan_crc32c) {
  storage::SessionContent content;
  content.mutable_scan_crc32c()->Add(scan_crc32c.begin(), scan_crc32c.end());
  return EncodeRecord(content);
}

absl::StatusOr<std::vector<uint32_t>> DecodeContent(std::string_view bytes) {
  const absl::StatusOr<storage::SessionContent> content =
      DecodeRecord<storage::SessionContent>(bytes, "session content");
  if (!content.ok()) return content.status();
  return std::vector<uint32_t>(content->scan_crc32c().begin(), content->scan_crc32c().end());
}

std::string EncodeCleanup(const SessionCleanup& cleanup) {
  storage::SessionCleanup row;
  row.set_incarnation(cleanup.incarnation);
  row.set_scans_only(cleanup.scans_only);
  row.set_scan_count(cleanup.scan_count);
  return EncodeRecord(row);
}

absl::StatusOr<SessionCleanup> DecodeCleanup(std::string_view bytes) {
  const absl::StatusOr<storage::SessionCleanup> row = DecodeRecord<storage::SessionCleanup>(bytes, "cleanup row");
  if (!row.ok()) return row.status();
  return SessionCleanup{row->incarnation(), row->scans_only(), row->scan_count()};
}

std::string EncodePoses(std::span<const Pose> poses) {
  storage::PoseChunk chunk;
  for (const Pose& pose : poses) {
    for (const double entry : RowsOf(pose)) chunk.add_rows(entry);
  }
  return EncodeRecord(chunk);
}

absl::StatusOr<std::vector<Pose>> DecodePoses(std::string_view bytes) {
  const absl::StatusOr<storage::PoseChunk> chunk = DecodeRecord<storage::PoseChunk>(bytes, "aligned poses");
  if (!chunk.ok()) return chunk.status();
  if (chunk->rows_size() % 12 != 0) return absl::DataLossError("aligned poses: they are not twelve numbers each");
  std::vector<Pose> poses(chunk->rows_size() / 12, Pose::Identity());
  for (int i = 0; i < chunk->rows_size(); ++i) poses[i / 12].matrix()(i % 12 / 4, i % 4) = chunk->rows(i);
  return poses;
}

}  // namespace mapkeep
