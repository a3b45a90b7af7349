#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "core/geometry/progress.h"
#include "server/config.h"
#include "storage/engine.h"
#include "storage/map_store.h"
#include "storage/session_store.h"

namespace mapkeep {

/// What a replay found.
struct ReplayReport {
  uint64_t commits = 0;    ///< made again, rollbacks among them
  uint64_t blocks = 0;     ///< compared, over all epochs that can be read
  uint64_t different = 0;  ///< that are not equal
  std::string first_difference;
};

/// Runs every session of a map again, in the order of its commit records and each on its base epoch, in a RocksDB in
/// `directory` (made, and the caller's to remove), and compares each epoch that can still be read with what came out:
/// the blocks of the tiles that the commit touched, and at the end every block of the head. With the parameters that
/// made the map on the same binary there is no difference, whoever committed and in whatever race: that is what "the
/// same map" means. FAILED_PRECONDITION naming the session if one was deleted or its scans were not kept.
absl::StatusOr<ReplayReport> ReplayMap(Engine& engine, MapStore& maps, SessionStore& sessions,
                                       const StageParameters& parameters, const std::string& map,
                                       const std::string& directory, const Progress& progress = {});

}  // namespace mapkeep
