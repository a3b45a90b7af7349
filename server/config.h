#pragma once

#include <cstdint>
#include <string>

#include "core/dor/parameters.h"
#include "core/ratio_map/map_filter.h"
#include "core/ratio_map/merge.h"
#include "core/ratio_map/session_map.h"
#include "core/registration/aligner.h"

namespace mapkeep {

/// Where to listen. Port 0 picks a free one.
struct Endpoint {
  std::string host;  ///< a name, an IPv4 or an IPv6 address (without brackets)
  int port = 0;
  bool operator==(const Endpoint&) const = default;
};

/// "HOST:PORT", an IPv6 host in brackets.
std::string ToString(const Endpoint& endpoint);

/// Bounds on what clients and jobs may take.
struct Limits {
  int jobs = 2;                 ///< sessions at work at a time, each of another map
  int storage_threads = 8;      ///< threads for calls that read or write the store
  int upload_pending_mib = 32;  ///< scans of one upload that are received but not durable yet, MiB
  int block_cache_mib = 256;    ///< decoded blocks kept in memory, MiB
  int lease_seconds = 30;       ///< after which a job of a daemon that vanished may be taken over
  int watch_seconds = 300;      ///< after which WatchSession ends itself
  int drain_seconds = 0;        ///< between "not ready" and the end of service, for load balancers to notice
  int shutdown_seconds = 10;    ///< that open calls get to end
};

enum class EngineChoice { kRocksDb, kRados };

/// What the store lies on.
struct EngineConfig {
  EngineChoice choice = EngineChoice::kRocksDb;
  std::string rados_conf, rados_pool = "mapkeep", rados_namespace, rados_user = "admin", rados_keyring;
};

/// How much of the past is kept.
struct History {
  int keep_epochs = 1000;         ///< the newest ones of a map
  double keep_days = 0;           ///< and those that were the newest one so recently
  int collect_seconds = 300;      ///< between collections; 0: never
  int values_per_second = 20000;  ///< that a collection deletes; 0: no limit
  bool keep_scans = false;        ///< of every session, also those that do not ask for it
};

/// The parameters of the pipeline's stages. Voxel sizes in here are not settings: each map has its own.
struct StageParameters {
  AlignParameters align;
  DorParameters clean;
  SessionMapParameters session_map;
  MergeParameters merge;
  MapFilterParameters filter;
};

enum class LogFormat { kText, kJson };

/// Everything that mapkeepd can be told; see server/settings.h for names, ranges and meanings.
struct Config {
  std::string data = "mapkeep-data";
  Endpoint listen{"127.0.0.1", 7443};
  Endpoint admin{"127.0.0.1", 7444};
  Endpoint http;    ///< no host: off
  int threads = 0;  ///< of the pipeline's parallel loops; 0: all cores
  LogFormat log_format = LogFormat::kText;
  std::string ports_file;  ///< empty: none
  Limits limits;
  EngineConfig engine;
  History history;
  StageParameters stages;
};

}  // namespace mapkeep
