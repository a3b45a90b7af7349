#include "client/cli/json_values.h"

#include <nlohmann/json.hpp>
#include <string>

namespace mapkeep {
namespace {

nlohmann::json JsonOf(const SessionInfo::Report& report) {
  nlohmann::json windows = nlohmann::json::array();
  for (const SessionInfo::Window& window : report.windows) {
    windows.push_back({{"first_scan", window.first_scan},
                       {"last_scan", window.last_scan},
                       {"fitness", window.fitness},
                       {"inliers", window.inliers},
                       {"correction", window.correction},
                       {"rotation", window.rotation},
                       {"observability", window.observability},
                       {"precision", window.precision},
                       {"coverage", window.coverage},
                       {"trusted", window.trusted}});
  }
  nlohmann::json stages = nlohmann::json::array();
  for (const SessionInfo::StageSeconds& stage : report.stages) {
    stages.push_back({{"stage", stage.stage}, {"seconds", stage.seconds}});
  }
  return {{"windows", windows},
          {"stages", stages},
          {"points", report.points},
          {"points_removed", report.points_removed},
          {"points_restored", report.points_restored},
          {"session_voxels", report.session_voxels},
          {"voxels_kept", report.voxels_kept},
          {"static_voxels", report.static_voxels},
          {"blocks_touched", report.blocks_touched},
          {"base_epoch", report.base_epoch},
          {"epoch", report.epoch}};
}

}  // namespace

nlohmann::json JsonOf(const Eigen::Vector3d& point) { return {point.x(), point.y(), point.z()}; }

nlohmann::json JsonOf(const MapInfo& map) {
  nlohmann::json json = {{"name", map.name},
                         {"voxel_size", map.voxel_size},
                         {"crs", map.crs},
                         {"epoch", map.epoch},
                         {"created", map.created},
                         {"voxels", map.voxels},
                         {"static_voxels", map.static_voxels},
                         {"blocks", map.blocks},
                         {"tiles", map.tiles},
                         {"sessions", map.sessions}};
  if (map.origin.has_value()) json["origin"] = JsonOf(*map.origin);
  if (map.bounds.has_value()) json["bounds"] = {{"min", JsonOf(map.bounds->min())}, {"max", JsonOf(map.bounds->max())}};
  return json;
}

nlohmann::json JsonOf(const VoxelInfo& voxel) {
  return {{"epoch", voxel.epoch},         {"hits", voxel.hits},
          {"exposures", voxel.exposures}, {"stability", voxel.stability},
          {"ground", voxel.ground},       {"is_static", voxel.is_static},
          {"is_new", voxel.is_new},       {"first_seen", voxel.first_seen},
          {"last_seen", voxel.last_seen}, {"mean", JsonOf(Eigen::Vector3d(voxel.mean))},
          {"intensity", voxel.intensity}};
}

nlohmann::json JsonOf(const SessionInfo& session) {
  nlohmann::json json = {{"map", session.map},
                         {"id", session.id},
                         {"robot", session.robot},
                         {"state", NameOf(session.state)},
                         {"scan_count", session.scan_count},
                         {"durable_scans", session.durable_scans},
                         {"payload_bytes", session.payload_bytes},
                         {"keep_scans", session.keep_scans},
                         {"created", session.created},
                         {"ended", session.ended},
                         {"start_time", session.start_time},
                         {"stage", session.stage},
                         {"stage_progress", session.stage_progress},
                         {"reason", session.reason}};
  if (session.report.has_value()) json["report"] = JsonOf(*session.report);
  return json;
}

}  // namespace mapkeep
