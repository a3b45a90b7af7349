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
  int scan_cache_mib = 256;     ///< decoded scans of sessions at work kept in memory, MiB
  int plan_cache_mib = 256;     ///< plans of tiles kept in memory, MiB
  int rpc_memory_mib = 512;     ///< gRPC's buffers of all connections together, MiB
  int keepalive_seconds = 20;   ///< of silence after which a gRPC peer is asked whether it is there
  int handshake_seconds = 20;   ///< in which a new gRPC connection must have said who it is
  int lease_seconds = 30;       ///< after which a job of a daemon that vanished may be taken over
  int watch_seconds = 300;      ///< after which WatchSession and WatchMap end themselves
  int drain_seconds = 0;        ///< between "not ready" and the end of service, for load balancers to notice
  int shutdown_seconds = 10;    ///< that open calls get to end
};

/// The listener of pages and tiles.
struct HttpConfig {
  std::string assets;        ///< directory of the viewer's files; empty: beside the program, see FindAssets
  std::string cors_origins;  ///< whose pages may read answers: "*", origins separated by blanks, or nothing
  int threads = 2;           ///< that move bytes; as many make tiles
  int connections = 1024;    ///< at most
  int cache_mib = 256;       ///< tiles and what they are made of, MiB
  int stall_seconds = 30;    ///< after which a client that takes or sends nothing is cut off
};

enum class EngineChoice { kRocksDb, kRados };

/// What the store lies on.
struct EngineConfig {
  EngineChoice choice = EngineChoice::kRocksDb;
  int rocksdb_block_cache_mib = 64;   ///< index and data blocks of RocksDB's files kept in memory, MiB
  int rocksdb_write_buffer_mib = 64;  ///< writes that are not in RocksDB's files yet, all together, MiB
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

/// What may be under way at a time: sessions begun and not committed, sessions committed and not at their end, and MiB
/// of the scans of both. 0: no limit.
struct QuotaConfig {
  int robot_sessions = 32, robot_jobs = 128, robot_mib = 64 << 10;
  int map_sessions = 1000, map_jobs = 10'000, map_mib = 1 << 20;
  int retry_seconds = 15;  ///< after which whoever was refused is told to come again
};

/// How the listeners are guarded.
struct Security {
  std::string tls_cert, tls_key;  ///< PEM files; empty: no TLS
  std::string tls_client_ca;      ///< PEM file: gRPC clients need a certificate of these; empty: they need none
  std::string tokens;             ///< file, see server/auth/token_table.h; empty: anybody may do everything
  bool insecure = false;          ///< listen beyond loopback without TLS or without tokens
};

/// Everything that mapkeepd can be told; see server/settings.h for names, ranges and meanings.
struct Config {
  std::string data = "mapkeep-data";
  Endpoint listen{"127.0.0.1", 7443};
  Endpoint admin{"127.0.0.1", 7444};
  Endpoint http;                ///< no host: off
  int threads = 0;              ///< of the pipeline's parallel loops; 0: all cores
  bool serial_per_map = false;  ///< a map's sessions are merged strictly in the order of CommitSession
  LogFormat log_format = LogFormat::kText;
  std::string ports_file;  ///< empty: none
  Security security;
  QuotaConfig quota;
  Limits limits;
  HttpConfig pages;
  EngineConfig engine;
  History history;
  StageParameters stages;
};

}  // namespace mapkeep
