#include "server/settings.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace mapkeep {
namespace {

template <typename T>
using Field = T& (*)(Config&);

template <typename T>
T Read(Field<T> field, const Config& config) {
  Config copy = config;
  return field(copy);
}

std::optional<std::string> TextOf(const SettingValue& value) {
  if (const auto* flag = std::get_if<FlagText>(&value)) return flag->text;
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  return {};
}

std::optional<int64_t> IntegerOf(const SettingValue& value) {
  if (const auto* integer = std::get_if<int64_t>(&value)) return *integer;
  int64_t parsed = 0;
  const auto* flag = std::get_if<FlagText>(&value);
  return flag != nullptr && absl::SimpleAtoi(flag->text, &parsed) ? std::optional(parsed) : std::nullopt;
}

std::optional<double> NumberOf(const SettingValue& value) {
  if (const auto* number = std::get_if<double>(&value)) return *number;
  if (const auto integer = IntegerOf(value)) return static_cast<double>(*integer);
  double parsed = 0;
  const auto* flag = std::get_if<FlagText>(&value);
  return flag != nullptr && absl::SimpleAtod(flag->text, &parsed) ? std::optional(parsed) : std::nullopt;
}

std::optional<Endpoint> EndpointOf(std::string_view text) {
  const size_t colon = text.rfind(':');
  int port = 0;
  if (colon == std::string_view::npos || !absl::SimpleAtoi(std::string(text.substr(colon + 1)), &port) || port < 0 ||
      port > 65535) {
    return {};
  }
  std::string_view host = text.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string_view::npos) {
    return {};
  }
  if (host.empty()) return {};
  return Endpoint{std::string(host), port};
}

template <typename T>
Setting IntegerIn(std::string name, Field<T> field, int64_t low, int64_t high, std::string about) {
  return {std::move(name), absl::StrFormat("an integer from %d to %d", low, high), std::move(about),
          [field](const Config& config) { return absl::StrCat(Read(field, config)); },
          [field, low, high](Config& config, const SettingValue& value) {
            const auto integer = IntegerOf(value);
            if (!integer || *integer < low || *integer > high) return false;
            field(config) = static_cast<T>(*integer);
            return true;
          }};
}

Setting Integer(std::string name, Field<int> field, int low, int high, std::string about) {
  return IntegerIn<int>(std::move(name), field, low, high, std::move(about));
}

Setting Number(std::string name, Field<double> field, double low, double high, std::string about) {
  return {std::move(name), absl::StrFormat("a number from %g to %g", low, high), std::move(about),
          [field](const Config& config) { return absl::StrCat(Read(field, config)); },
          [field, low, high](Config& config, const SettingValue& value) {
            const auto number = NumberOf(value);
            if (!number || !(*number >= low && *number <= high)) return false;
            field(config) = *number;
            return true;
          }};
}

Setting Path(std::string name, Field<std::string> field, bool may_be_empty, std::string expects, std::string about) {
  return {std::move(name), std::move(expects), std::move(about),
          [field](const Config& config) { return Read(field, config); },
          [field, may_be_empty](Config& config, const SettingValue& value) {
            auto text = TextOf(value);
            if (!text || (text->empty() && !may_be_empty)) return false;
            field(config) = *std::move(text);
            return true;
          }};
}

Setting Address(std::string name, Field<Endpoint> field, bool may_be_off, std::string about) {
  return {std::move(name), may_be_off ? "HOST:PORT, or nothing for off" : "HOST:PORT", std::move(about),
          [field](const Config& config) { return ToString(Read(field, config)); },
          [field, may_be_off](Config& config, const SettingValue& value) {
            const auto text = TextOf(value);
            if (!text) return false;
            const auto endpoint = text->empty() && may_be_off ? Endpoint{} : EndpointOf(*text);
            if (!endpoint) return false;
            field(config) = *endpoint;
            return true;
          }};
}

Setting Boolean(std::string name, Field<bool> field, std::string about) {
  return {std::move(name), "true or false", std::move(about),
          [field](const Config& config) { return Read(field, config) ? "true" : "false"; },
          [field](Config& config, const SettingValue& value) {
            bool parsed = false;
            const auto* flag = std::get_if<FlagText>(&value);
            const auto* boolean = std::get_if<bool>(&value);
            if (boolean == nullptr && (flag == nullptr || !absl::SimpleAtob(flag->text, &parsed))) return false;
            field(config) = boolean != nullptr ? *boolean : parsed;
            return true;
          }};
}

Setting StoreEngine(std::string about) {
  return {"engine", "rocksdb or rados", std::move(about),
          [](const Config& config) { return config.engine.choice == EngineChoice::kRados ? "rados" : "rocksdb"; },
          [](Config& config, const SettingValue& value) {
            const auto text = TextOf(value);
            if (text != "rocksdb" && text != "rados") return false;
            config.engine.choice = text == "rados" ? EngineChoice::kRados : EngineChoice::kRocksDb;
            return true;
          }};
}

Setting Engine(std::string about) {
  return {"clean.exposure_engine", "projection or ray_walk", std::move(about),
          [](const Config& config) {
            return config.stages.clean.exposure.engine == ExposureEngine::kRayWalk ? "ray_walk" : "projection";
          },
          [](Config& config, const SettingValue& value) {
            const auto text = TextOf(value);
            if (text != "projection" && text != "ray_walk") return false;
            config.stages.clean.exposure.engine =
                text == "ray_walk" ? ExposureEngine::kRayWalk : ExposureEngine::kProjection;
            return true;
          }};
}

Setting ScanPosesBy(std::string about) {
  return {"align.scan_poses", "pose_graph or fusion", std::move(about),
          [](const Config& config) {
            return config.stages.align.scan_poses == ScanPoses::kFusion ? "fusion" : "pose_graph";
          },
          [](Config& config, const SettingValue& value) {
            const auto text = TextOf(value);
            if (text != "pose_graph" && text != "fusion") return false;
            config.stages.align.scan_poses = text == "fusion" ? ScanPoses::kFusion : ScanPoses::kPoseGraph;
            return true;
          }};
}

Setting Format(std::string about) {
  return {"log_format", "text or json", std::move(about),
          [](const Config& config) { return config.log_format == LogFormat::kJson ? "json" : "text"; },
          [](Config& config, const SettingValue& value) {
            const auto text = TextOf(value);
            if (text != "text" && text != "json") return false;
            config.log_format = text == "json" ? LogFormat::kJson : LogFormat::kText;
            return true;
          }};
}

// A field of the configuration as a captureless function, so that a row of the table stays one line.
#define MAPKEEP_FIELD(path) \
  [](Config & c) -> auto& { return c.path; }

std::vector<Setting> MakeSettings() {
  return {
      Path("data", MAPKEEP_FIELD(data), false, "a directory", "Where maps and sessions are kept; made if absent"),
      Address("listen", MAPKEEP_FIELD(listen), false, "gRPC; port 0 picks a free one"),
      Address("admin", MAPKEEP_FIELD(admin), false, "HTTP /livez, /readyz and /metrics, on threads of its own"),
      Address("http", MAPKEEP_FIELD(http), true, "HTTP pages and tiles: the viewer, 3D Tiles, JSON"),
      Integer("threads", MAPKEEP_FIELD(threads), 0, 1024, "Threads of the pipeline's parallel loops; 0: all cores"),
      Boolean(
          "serial_per_map", MAPKEEP_FIELD(serial_per_map),
          "Merge a map's sessions strictly in the order of CommitSession, also if they are on several daemons or one "
          "is put off: the same sessions then give the same map, whatever fails meanwhile"),
      Format("Form of the log lines on standard error"),
      Path("ports_file", MAPKEEP_FIELD(ports_file), true, "a file, or nothing",
           "Written as JSON once serving: the ports that were picked"),
      Path(
          "tls_cert", MAPKEEP_FIELD(security.tls_cert), true, "a file, or nothing",
          "PEM: the daemon's certificate and its chain; with it every listener speaks TLS. Read again when it changes"),
      Path("tls_key", MAPKEEP_FIELD(security.tls_key), true, "a file, or nothing", "PEM: its private key"),
      Path("tls_client_ca", MAPKEEP_FIELD(security.tls_client_ca), true, "a file, or nothing",
           "PEM: gRPC clients must show a certificate of one of these authorities"),
      Path("tokens", MAPKEEP_FIELD(security.tokens), true, "a file, or nothing",
           "Who may do what, a line a token (`mapkeepd token` makes them); nothing: everybody everything"),
      Boolean("insecure", MAPKEEP_FIELD(security.insecure),
              "Let a listener that other machines reach do without TLS or without tokens"),

      Path("http_assets", MAPKEEP_FIELD(pages.assets), true, "a directory, or nothing",
           "The viewer's files; nothing: ../viewer or ../share/mapkeep/viewer from the program"),
      Path("http_cors", MAPKEEP_FIELD(pages.cors_origins), true, "origins separated by blanks, *, or nothing",
           "Sites whose pages may read what HTTP serves"),

      StoreEngine("What maps and sessions lie on: RocksDB under `data`, or a pool of a Ceph cluster"),
      Integer("rocksdb.block_cache_mib", MAPKEEP_FIELD(engine.rocksdb_block_cache_mib), 1, 1 << 20,
              "MiB of RocksDB's files kept in memory: blocks, indices and filters"),
      Integer("rocksdb.write_buffer_mib", MAPKEEP_FIELD(engine.rocksdb_write_buffer_mib), 1, 1 << 20,
              "MiB of writes that are not in RocksDB's files yet; twice as many while they are written there"),
      Path("rados.conf", MAPKEEP_FIELD(engine.rados_conf), true, "a file, or nothing",
           "ceph.conf of the cluster; nothing: where Ceph looks for it"),
      Path("rados.pool", MAPKEEP_FIELD(engine.rados_pool), false, "a name", "Pool, which must exist"),
      Path("rados.namespace", MAPKEEP_FIELD(engine.rados_namespace), true, "a name, or nothing",
           "Inside the pool, so that several fleets may share one"),
      Path("rados.user", MAPKEEP_FIELD(engine.rados_user), false, "a name", "Of cephx: client.<user>"),
      Path("rados.keyring", MAPKEEP_FIELD(engine.rados_keyring), true, "a file, or nothing",
           "With the user's key; nothing: as ceph.conf says"),
      Integer("history.keep_epochs", MAPKEEP_FIELD(history.keep_epochs), 1, 1 << 30,
              "Newest epochs of a map that stay readable; tagged ones stay as well"),
      Number("history.keep_days", MAPKEEP_FIELD(history.keep_days), 0, 36500,
             "Epochs that were the newest one so recently stay, too"),
      Integer("history.collect_seconds", MAPKEEP_FIELD(history.collect_seconds), 0, 86400,
              "Seconds between collections of what is not kept; 0: only when asked"),
      Integer("history.values_per_second", MAPKEEP_FIELD(history.values_per_second), 0, 1 << 30,
              "Values that a collection deletes in a second; 0: no limit"),
      Boolean("history.keep_scans", MAPKEEP_FIELD(history.keep_scans),
              "Keep the scans of every session: `admin replay` and retries after a rollback need them"),
      Integer("limits.jobs", MAPKEEP_FIELD(limits.jobs), 1, 64, "Sessions at work at a time, each of another map"),
      Integer("limits.storage_threads", MAPKEEP_FIELD(limits.storage_threads), 1, 256,
              "Threads for calls that read or write the store"),
      Integer("limits.upload_pending_mib", MAPKEEP_FIELD(limits.upload_pending_mib), 1, 1024,
              "MiB of scans of one upload that are received but not durable yet; above it nothing more is read"),
      Integer("limits.block_cache_mib", MAPKEEP_FIELD(limits.block_cache_mib), 1, 1 << 20,
              "MiB of decoded blocks kept in memory"),
      Integer("limits.scan_cache_mib", MAPKEEP_FIELD(limits.scan_cache_mib), 0, 1 << 20,
              "MiB of decoded scans of the sessions at work kept in memory, so that not every stage reads them anew"),
      Integer(
          "limits.plan_cache_mib", MAPKEEP_FIELD(limits.plan_cache_mib), 1, 1 << 20,
          "MiB of plans of tiles that first matches look into kept in memory, of each tile the last; others are read "
          "from the store"),
      Integer("limits.rpc_memory_mib", MAPKEEP_FIELD(limits.rpc_memory_mib), 32, 1 << 20,
              "MiB of gRPC's buffers, and as many of scans not durable yet, of all clients together; near it all are "
              "read more slowly"),
      Integer("limits.keepalive_seconds", MAPKEEP_FIELD(limits.keepalive_seconds), 1, 3600,
              "Seconds of silence after which a gRPC peer is asked whether it is there; it has half as many to answer, "
              "5 at least"),
      Integer("limits.handshake_seconds", MAPKEEP_FIELD(limits.handshake_seconds), 1, 600,
              "Seconds in which a new gRPC connection must have begun to speak HTTP/2"),
      Integer("limits.http_threads", MAPKEEP_FIELD(pages.threads), 1, 256,
              "Threads that move the bytes of pages and tiles; as many make tiles"),
      Integer("limits.http_connections", MAPKEEP_FIELD(pages.connections), 1, 1 << 20,
              "HTTP connections at a time; the one that was idle longest makes room"),
      Integer("limits.http_cache_mib", MAPKEEP_FIELD(pages.cache_mib), 1, 1 << 20,
              "MiB of tiles, and of what coarser tiles are made of, kept in memory; half as much for tiles as gRPC "
              "sends them"),
      Integer("limits.http_stall_seconds", MAPKEEP_FIELD(pages.stall_seconds), 1, 3600,
              "Seconds after which an HTTP client that takes no byte or does not finish its request is cut off"),
      Integer("limits.lease_seconds", MAPKEEP_FIELD(limits.lease_seconds), 3, 3600,
              "Seconds after which the job of a daemon that vanished may be taken over by another"),
      Integer("limits.watch_seconds", MAPKEEP_FIELD(limits.watch_seconds), 1, 86400,
              "Seconds after which WatchSession and WatchMap end themselves; the client watches again"),
      Integer("limits.drain_seconds", MAPKEEP_FIELD(limits.drain_seconds), 0, 3600,
              "Seconds between /readyz failing and the end of service; a few behind a load balancer"),
      Integer("limits.shutdown_seconds", MAPKEEP_FIELD(limits.shutdown_seconds), 0, 3600,
              "Seconds that open calls get to end"),

      Integer("quota.robot_sessions", MAPKEEP_FIELD(quota.robot_sessions), 0, 1 << 30,
              "Sessions of one robot that are begun and not committed; 0: no limit. Robots without a name have none"),
      Integer("quota.robot_jobs", MAPKEEP_FIELD(quota.robot_jobs), 0, 1 << 30,
              "Sessions of one robot that are committed and not at their end; 0: no limit"),
      Integer("quota.robot_mib", MAPKEEP_FIELD(quota.robot_mib), 0, 1 << 30,
              "MiB of scans of both, 16 bytes a point; 0: no limit"),
      Integer("quota.map_sessions", MAPKEEP_FIELD(quota.map_sessions), 0, 1 << 30,
              "Likewise quota.robot_sessions, of all robots of one map"),
      Integer("quota.map_jobs", MAPKEEP_FIELD(quota.map_jobs), 0, 1 << 30,
              "Likewise quota.robot_jobs, of all robots of one map"),
      Integer("quota.map_mib", MAPKEEP_FIELD(quota.map_mib), 0, 1 << 30,
              "Likewise quota.robot_mib, of all robots of one map"),
      Integer("quota.retry_seconds", MAPKEEP_FIELD(quota.retry_seconds), 1, 86400,
              "Seconds after which whoever was refused for a quota is told to try again"),

      Integer("align.window_scans", MAPKEEP_FIELD(stages.align.window_scans), 1, 10000, "L: scans of a window"),
      Number("align.window_travel", MAPKEEP_FIELD(stages.align.window_travel), 0.1, 10000,
             "Metres of travel after which a window ends before L scans"),
      Integer("align.window_stride", MAPKEEP_FIELD(stages.align.window_stride), 1, 10000,
              "r: scans between the starts of windows"),
      Number("align.source_voxel", MAPKEEP_FIELD(stages.align.source_voxel), 0.01, 10,
             "Metres to which query submaps are thinned"),
      Number("align.coarse_correspondence", MAPKEEP_FIELD(stages.align.coarse_correspondence), 0.01, 100,
             "Metres: largest distance of a match in the first round"),
      Number("align.fine_correspondence", MAPKEEP_FIELD(stages.align.fine_correspondence), 0.01, 100,
             "Metres: likewise in the last round"),
      Number("align.inlier_distance", MAPKEEP_FIELD(stages.align.inlier_distance), 0.01, 100, "tau_d, metres"),
      Number("align.min_fitness", MAPKEEP_FIELD(stages.align.min_fitness), 0, 1, "tau_f, after refinement"),
      Integer("align.min_inliers", MAPKEEP_FIELD(stages.align.min_inliers), 0, 1000000,
              "Matched points below which a window says nothing"),
      Number("align.max_correction", MAPKEEP_FIELD(stages.align.max_correction), 0, 1000,
             "Metres that refinement may move a window from its prior"),
      Number("align.max_rotation", MAPKEEP_FIELD(stages.align.max_rotation), 0, 3.2, "Radians, likewise"),
      Number("align.min_observability", MAPKEEP_FIELD(stages.align.min_observability), 0, 1,
             "Below it the surroundings leave a direction open, and the window is not trusted"),
      Number("align.coarse_robust_width", MAPKEEP_FIELD(stages.align.coarse_robust_width), 0.001, 100,
             "Metres off a surface at which a pair counts half in the first round"),
      Number("align.fine_robust_width", MAPKEEP_FIELD(stages.align.fine_robust_width), 0.001, 100,
             "Metres: likewise in the last round"),
      Number("align.max_tilt", MAPKEEP_FIELD(stages.align.max_tilt), 0, 180,
             "Degrees that z may be off the up direction in a session that founds a map"),
      Integer("align.max_iterations", MAPKEEP_FIELD(stages.align.max_iterations), 1, 1000, "Iterations of a round"),
      Number("align.query_range", MAPKEEP_FIELD(stages.align.query_range), 1, 1000,
             "Metres: points further from their sensor are not used"),
      Number("align.min_precision", MAPKEEP_FIELD(stages.align.min_precision), 0, 1,
             "Share of a window's inliers within 0.1 m of the map's surfaces, to be trusted"),
      Number("align.min_coverage", MAPKEEP_FIELD(stages.align.min_coverage), 0, 1,
             "Share of a window where the map knows anything; below it lies beyond the map"),
      Number("align.first_structure", MAPKEEP_FIELD(stages.align.first_structure), 0, 1,
             "How well what stands upright must fit in a window that no other one leads to"),
      Number("align.first_fitness", MAPKEEP_FIELD(stages.align.first_fitness), 0, 1,
             "Likewise align.min_fitness, of a window that is found by descriptors alone"),
      Number("align.first_precision", MAPKEEP_FIELD(stages.align.first_precision), 0, 1,
             "Likewise align.min_precision"),
      Number("align.first_coverage", MAPKEEP_FIELD(stages.align.first_coverage), 0, 1, "Likewise align.min_coverage"),
      Number("align.alias_share", MAPKEEP_FIELD(stages.align.alias_share), 0, 1,
             "A second place that fits with this share of the best one's score makes a window ambiguous"),
      Number("align.agree_distance", MAPKEEP_FIELD(stages.align.agree_distance), 0, 100,
             "Metres that two windows may disagree by"),
      Number("align.agree_per_metre", MAPKEEP_FIELD(stages.align.agree_per_metre), 0, 1,
             "Metres more a metre of travel between them"),
      Number("align.agree_rotation", MAPKEEP_FIELD(stages.align.agree_rotation), 0, 3.2,
             "Radians that two windows may disagree by"),
      Number("align.agree_turn", MAPKEEP_FIELD(stages.align.agree_turn), 0, 1,
             "Radians more a metre of travel between them"),
      Integer("align.max_matched_windows", MAPKEEP_FIELD(stages.align.max_matched_windows), 1, 1000,
              "Windows that are matched globally before a session is refused"),
      Number("align.prior_reach", MAPKEEP_FIELD(stages.align.prior_reach), 0, 10000,
             "Metres from an initial pose within which the matcher looks"),
      Integer("align.lost_windows", MAPKEEP_FIELD(stages.align.lost_windows), 1, 1000,
              "Windows in a row without trust after which the matcher is asked again"),
      Number("align.min_trusted_share", MAPKEEP_FIELD(stages.align.min_trusted_share), 0, 1,
             "Share of the windows inside the map that must be trusted"),
      ScanPosesBy("Scan poses by a pose graph over windows and odometry, or by the paper's eq. 2"),

      Number("clean.eta", MAPKEEP_FIELD(stages.clean.eta), 1e-9, 1, "eta of eq. 4, scans"),
      Number("clean.stability_threshold", MAPKEEP_FIELD(stages.clean.stability_threshold), 0, 1,
             "R below it: a dynamic candidate"),
      Integer("clean.window_radius", MAPKEEP_FIELD(stages.clean.window_radius), 0, 1000000,
              "k of eq. 3: scans to either side; 0: the whole session"),
      Boolean("clean.refine_poses", MAPKEEP_FIELD(stages.clean.refine_poses),
              "Take the noise from scan to scan out of the poses before removal"),
      Number("clean.refinement_cell", MAPKEEP_FIELD(stages.clean.refinement.cell), 0.05, 10,
             "Metres: edge of the cells in which a surface is taken for a plane"),
      Integer("clean.refinement_points", MAPKEEP_FIELD(stages.clean.refinement.points), 1, 1000000,
              "Points of a scan that are laid onto the planes"),
      Integer("clean.refinement_rounds", MAPKEEP_FIELD(stages.clean.refinement.rounds), 1, 100,
              "Times that the planes are taken from the poses of the round before"),
      Number("clean.refinement_robust_width", MAPKEEP_FIELD(stages.clean.refinement.robust_width), 0.001, 10,
             "Metres off its plane at which a point counts a quarter"),
      Number("clean.refinement_max_correction", MAPKEEP_FIELD(stages.clean.refinement.max_correction), 0, 10,
             "Metres; a scan that would move farther keeps its pose"),
      Number("clean.refinement_max_rotation", MAPKEEP_FIELD(stages.clean.refinement.max_rotation), 0, 1,
             "Radians, likewise"),
      Number("clean.refinement_min_gain", MAPKEEP_FIELD(stages.clean.refinement.min_gain), 0, 1,
             "Share by which points must come closer to their planes, or all poses stay as given"),
      Engine("How exposures are counted: voxels asked for a ray, or rays walked (the reference)"),
      Boolean("clean.exposure_sub_voxels", MAPKEEP_FIELD(stages.clean.exposure.sub_voxels),
              "A ray exposes a voxel only where the session has points in it, to a quarter of its edge"),
      Boolean("clean.exposure_neighbour_hits", MAPKEEP_FIELD(stages.clean.exposure.neighbour_hits),
              "A voxel is not exposed by a scan that hits one beside it in its layer"),
      Number("clean.exposure_margin_by_range", MAPKEEP_FIELD(stages.clean.exposure.margin_by_range), 0, 1,
             "The last part of a ray exposes nothing: metres a metre of its length"),
      Number("clean.exposure_clear_around", MAPKEEP_FIELD(stages.clean.exposure.clear_around), 0, 10,
             "A void is confirmed if all rays so close around its voxel end far behind it, metres; 0: none is"),
      Number("clean.exposure_clear_behind", MAPKEEP_FIELD(stages.clean.exposure.clear_behind), 0, 100,
             "How far behind it they must end, metres"),
      Boolean("clean.protect_ground", MAPKEEP_FIELD(stages.clean.protect_ground),
              "The ground is never removed for its R"),
      Number("clean.ground_slope", MAPKEEP_FIELD(stages.clean.ground_slope), 0, 1,
             "tau_slope: |n_z| above it makes a voxel a ground anchor"),
      Number("clean.ground_tolerance", MAPKEEP_FIELD(stages.clean.ground_tolerance), 0, 10,
             "delta_ground: voxels this close to the local ground height are ground, metres"),
      Number("clean.ground_cell", MAPKEEP_FIELD(stages.clean.ground_cell), 0.05, 100,
             "Edge of a cell of the height grid, metres"),
      Number("clean.ground_step", MAPKEEP_FIELD(stages.clean.ground_step), 0, 10,
             "Ground goes on into the next cell if its height differs by less, metres"),
      Boolean("clean.cluster", MAPKEEP_FIELD(stages.clean.cluster), "Decide on DBSCAN clusters (eq. 5), not voxels"),
      Number("clean.candidate_threshold", MAPKEEP_FIELD(stages.clean.candidate_threshold), 0, 1,
             "R below it: takes part in the clusters"),
      Number("clean.cluster_radius", MAPKEEP_FIELD(stages.clean.cluster_radius), 0.01, 10, "epsilon of DBSCAN, metres"),
      Integer("clean.cluster_min_neighbours", MAPKEEP_FIELD(stages.clean.cluster_min_neighbours), 1, 1000,
              "N_min of DBSCAN"),
      Number("clean.cluster_threshold", MAPKEEP_FIELD(stages.clean.cluster_threshold), 0, 1,
             "tau_cluster: a cluster whose mean R is below it is dynamic"),
      Boolean("clean.confirm", MAPKEEP_FIELD(stages.clean.confirm),
              "What is dynamic by its R stays if no confirmed void is near"),
      Integer("clean.confirmed_scans", MAPKEEP_FIELD(stages.clean.confirmed_scans), 1, 1000000,
              "Scans in which a dynamic voxel must have been a confirmed void to count as one"),
      Number("clean.confirm_reach", MAPKEEP_FIELD(stages.clean.confirm_reach), 0.05, 100,
             "Edge of the cells in which, and in whose neighbours, it is looked for, metres"),
      Boolean("clean.doubt", MAPKEEP_FIELD(stages.clean.doubt),
              "What is dynamic by its R stays where it looks like leaves or a surface at a grazing angle"),
      Number("clean.doubt_hits", MAPKEEP_FIELD(stages.clean.doubt_hits), 0, 100,
             "What speaks for that, kept above a sum of 1: a logarithm of the voxel's hits"),
      Number("clean.doubt_returns", MAPKEEP_FIELD(stages.clean.doubt_returns), 0, 100,
             "The share of the hits around that came after exposures"),
      Number("clean.doubt_stability", MAPKEEP_FIELD(stages.clean.doubt_stability), 0, 100,
             "The share of hits in hits and exposures around"),
      Number("clean.doubt_voids", MAPKEEP_FIELD(stages.clean.doubt_voids), 0, 100,
             "Against it: the share of voxels around that were confirmed voids"),
      Boolean("clean.departures", MAPKEEP_FIELD(stages.clean.departures),
              "Find what stood still and then left, or came and stayed, by the order of scans"),
      Integer("clean.vacated_scans", MAPKEEP_FIELD(stages.clean.vacated_scans), 1, 1000000,
              "Scans that look through a voxel after its last hit for it to have been left"),
      Integer("clean.vacated_neighbours", MAPKEEP_FIELD(stages.clean.vacated_neighbours), 1, 1000,
              "Voxels of 0.2 m around it that were left at the same time, itself included"),
      Integer("clean.vacated_confirmed", MAPKEEP_FIELD(stages.clean.vacated_confirmed), 1, 1000,
              "Or so many that were confirmed as voids in two scans after their last hit"),
      Number("clean.departure_reach", MAPKEEP_FIELD(stages.clean.departure_reach), 0, 100,
             "Metres around those in which the rest of the object is looked for"),
      Boolean("clean.drive_offs", MAPKEEP_FIELD(stages.clean.drive_offs),
              "Find what stood until something set out beside it, where nobody looked again"),
      Integer("clean.setting_out", MAPKEEP_FIELD(stages.clean.setting_out), 1, 1000000,
              "Scans that it takes for its first two metres at least"),
      Boolean("clean.transients", MAPKEEP_FIELD(stages.clean.transients),
              "Find what was somewhere for a short while, where it was clear besides"),
      Number("clean.transient_reach", MAPKEEP_FIELD(stages.clean.transient_reach), 0, 2,
             "Metres around a voxel that are one place, 1.5 voxels at least"),
      Integer("clean.transient_scans", MAPKEEP_FIELD(stages.clean.transient_scans), 1, 1000000,
              "From the first to the last scan that hit anything there, at most"),
      Number("clean.transient_clear", MAPKEEP_FIELD(stages.clean.transient_clear), 0, 100,
             "Scans to which it was clear, for each of those and each voxel that was hit"),
      Boolean("clean.inherit", MAPKEEP_FIELD(stages.clean.inherit),
              "Voxels with little evidence follow those around them"),
      Integer("clean.decided_scans", MAPKEEP_FIELD(stages.clean.decided_scans), 0, 1000000,
              "H + E from which a voxel's own evidence decides, scans"),
      Boolean("clean.surround", MAPKEEP_FIELD(stages.clean.surround),
              "Voxels among dynamic ones that were looked through at all are dynamic"),
      Number("clean.surrounded_share", MAPKEEP_FIELD(stages.clean.surrounded_share), 0, 1,
             "Share of the voxels around, without ground, that must be dynamic"),
      Number(
          "clean.surrounded_time", MAPKEEP_FIELD(stages.clean.surrounded_time), 0, 1,
          "Share of the time in which anything around was hit; among dynamic voxels, what was hit for less is dynamic"),
      Number("clean.surround_reach", MAPKEEP_FIELD(stages.clean.surround_reach), 0, 2,
             "Metres around, 2.3 voxels at least, in which these times are compared"),
      Boolean("clean.verify_ankles", MAPKEEP_FIELD(stages.clean.verify_ankles),
              "Look for feet and wheels in ground voxels under dynamic ones"),
      Number("clean.ankle_tolerance", MAPKEEP_FIELD(stages.clean.ankle_tolerance), 0, 10,
             "delta_tol: their points this far above the voxel's mean height go, metres"),
      Boolean("clean.restore", MAPKEEP_FIELD(stages.clean.restore),
              "Give points of isolated dynamic voxels back with the probability of eq. 6"),
      IntegerIn<uint64_t>("clean.seed", MAPKEEP_FIELD(stages.clean.seed), 0, 2147483647, "Seed of eq. 6"),

      Number("merge.n_max_percentile", MAPKEEP_FIELD(stages.session_map.n_max_percentile), 0, 100,
             "Percentile of N_S that is N_max of eq. 8; 100 is the paper's maximum"),
      Number("merge.normal_radius_voxels", MAPKEEP_FIELD(stages.session_map.normal_radius_voxels), 1, 10,
             "Neighbourhood of a voxel's normal, in voxel edges"),
      Number("merge.gamma", MAPKEEP_FIELD(stages.merge.gamma), 0, 100, "gamma of eq. 8: how fast evidence decays"),
      Number("merge.alpha_min", MAPKEEP_FIELD(stages.merge.alpha_min), 0, 1, "alpha_min of eq. 8"),
      Number("merge.alpha_max", MAPKEEP_FIELD(stages.merge.alpha_max), 0, 1, "alpha_max of eq. 8"),
      IntegerIn<int>(
          "merge.contradicting_scans", MAPKEEP_FIELD(stages.merge.contradicting_scans), 0, 1000000,
          "Scans that look through a voxel of which none keeps a point, from which on alpha is contradicted_alpha; 0: "
          "eq. 8 alone"),
      Number("merge.contradicted_alpha", MAPKEEP_FIELD(stages.merge.contradicted_alpha), 0, 1,
             "What such a session leaves of a voxel's counts"),
      Number("merge.contradicted_share", MAPKEEP_FIELD(stages.merge.contradicted_share), 0, 2,
             "Share of the voxels around one that the session says nothing about that it must contradict, for it to be "
             "forgotten with them; above 1: never"),
      Number("merge.contradiction_reach", MAPKEEP_FIELD(stages.merge.contradiction_reach), 0, 2,
             "Metres around it, 2.3 voxels at least"),
      Number(
          "merge.cohort_looked_through", MAPKEEP_FIELD(stages.merge.cohort_looked_through), 0, 2,
          "Share of what one session was the first to see around a voxel that a later one has to look through for all "
          "of that to be forgotten; above 1: never"),
      Number("merge.cohort_met", MAPKEEP_FIELD(stages.merge.cohort_met), 0, 1,
             "Share of it that the later session may meet at most"),
      Number("merge.cohort_reach", MAPKEEP_FIELD(stages.merge.cohort_reach), 0, 6,
             "Metres around it, in cells of half of that"),
      Number(
          "merge.remnant_share", MAPKEEP_FIELD(stages.merge.remnant_share), 0, 1,
          "Of the voxels of a new thing beside which the session removed something, above which it is what is left of "
          "what moved, and not merged; 1: everything is merged"),

      Number("filter.eta", MAPKEEP_FIELD(stages.filter.eta), 1e-9, 1, "eta of eq. 4, scans"),
      Number("filter.stability_threshold", MAPKEEP_FIELD(stages.filter.stability_threshold), 0, 1,
             "R below it: not static, unless ground or in a cluster that is"),
      Number("filter.candidate_threshold", MAPKEEP_FIELD(stages.filter.candidate_threshold), 0, 1,
             "R below it, and not ground: takes part in the clusters"),
      Number("filter.cluster_radius", MAPKEEP_FIELD(stages.filter.cluster_radius), 0.01, 6.4,
             "epsilon of DBSCAN, metres"),
      Integer("filter.cluster_min_neighbours", MAPKEEP_FIELD(stages.filter.cluster_min_neighbours), 1, 1000,
              "N_min of DBSCAN"),
      Number("filter.cluster_threshold", MAPKEEP_FIELD(stages.filter.cluster_threshold), 0, 1, "tau_cluster of eq. 5"),
      Integer("filter.isolated_min_neighbours", MAPKEEP_FIELD(stages.filter.isolated_min_neighbours), 0, 26,
              "Occupied neighbours below which a voxel is isolated noise"),
      Number(
          "filter.probation_height", MAPKEEP_FIELD(stages.filter.probation_height), 0, 20,
          "Metres above ground that was known before, up to which what one session alone met, and that touches nothing "
          "known, waits for a second one; 0: nothing waits"),
      Number("filter.probation_width", MAPKEEP_FIELD(stages.filter.probation_width), 0, 20,
             "Metres across; of what would wait, what is wider does not; 0: however wide, it waits"),
      Integer("filter.probation_hits", MAPKEEP_FIELD(stages.filter.probation_hits), 0, 1000,
              "Scans; what one session alone met in no more, and that touches neither what was known nor what twice as "
              "many "
              "met, waits too, however wide; 0: none does"),
      Number(
          "filter.enclosure_reach", MAPKEEP_FIELD(stages.filter.enclosure_reach), 0, 6.4,
          "Metres within which something newer stands on two of four sides of a voxel that no session has met since, "
          "or on one if it was ever looked through, for it to be gone; 0: off"),
  };
}

#undef MAPKEEP_FIELD

}  // namespace

std::string ToString(const Endpoint& endpoint) {
  if (endpoint.host.empty()) return "";
  const bool is_v6 = endpoint.host.find(':') != std::string::npos;
  return absl::StrCat(is_v6 ? "[" : "", endpoint.host, is_v6 ? "]:" : ":", endpoint.port);
}

const std::vector<Setting>& Settings() {
  static const auto* const settings = new std::vector<Setting>(MakeSettings());
  return *settings;
}

const Setting* FindSetting(std::string_view name) {
  const auto found = std::ranges::find(Settings(), name, &Setting::name);
  return found == Settings().end() ? nullptr : &*found;
}

std::string FlagOf(const Setting& setting) {
  if (setting.name.find('.') != std::string::npos) return "";
  return absl::StrCat("--", absl::StrReplaceAll(setting.name, {{"_", "-"}}));
}

std::string SettingsTable() {
  std::string table = "| setting | default | expected | meaning |\n|---|---|---|---|\n";
  const Config defaults;
  for (const Setting& setting : Settings()) {
    const std::string value = setting.show(defaults);
    absl::StrAppendFormat(&table, "| `%s` | %s | %s | %s |\n", setting.name,
                          value.empty() ? "" : absl::StrCat("`", value, "`"), setting.expects, setting.about);
  }
  return table;
}

}  // namespace mapkeep
