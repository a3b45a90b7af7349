#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "storage/engine.h"
#include "storage/session_codec.h"

namespace mapkeep {

// Where sessions lie in the engine (numbers in names as in map_layout.h):
//
//   partition "sessions"          every map that ever had one
//     map/<map>                   random bits, changed whenever a session is made
//   partition "sessions/<map>"
//     session/<id>                StoredSession
//     content/<id>                checksums of its scans
//     created/<microseconds>/<id> the order of listing
//     active/<microseconds>/<id>  queued or running: its turn
//     lacking/<microseconds>/<id> refused, and to be tried again when there is more of the map
//     turn                        the newest turn given to any session of the map
//     cleanup/<incarnation>/...   SessionCleanup: values that are to go
//   values "session/<incarnation>"
//     scan/<index>                see scan_codec.h
//     poses/<random>/<chunk>      aligned poses

inline constexpr std::string_view kSessionMaps = "sessions";
inline constexpr std::string_view kNewestTurnRow = "turn";
std::string SessionMapRow(std::string_view map);
std::string SessionPartition(std::string_view map);
std::string SessionRowKey(std::string_view id);
std::string ContentRowKey(std::string_view id);
/// Sorts by creation time, then id.
std::string SessionPosition(const SessionRecord& record);
std::string SessionGroup(uint64_t incarnation);
std::string ScanKey(uint32_t index);
inline constexpr std::string_view kScanPrefix = "scan/";  ///< of every ScanKey
std::string CleanupRowKey(const SessionCleanup& cleanup);

/// Deletes the values that a cleanup names, then its row.
absl::Status FinishCleanup(Engine& engine, std::string_view map, const SessionCleanup& cleanup);

/// Finishes every deletion of scans and sessions that was broken off. Gives how many there were.
absl::StatusOr<uint64_t> FinishCleanups(Engine& engine);

}  // namespace mapkeep
