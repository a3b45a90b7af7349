#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string_view>

#include "storage/engine.h"
#include "storage/session_store.h"

namespace mapkeep {

/// Makes the records of a map's sessions agree with what rollbacks did: committed ones that are no longer in the map
/// become rolled back, those that are in it again become committed. A rollback leaves a row for each; this takes them
/// away, may be broken off anywhere and runs after a rollback and at every start. Gives how many records it changed.
/// NOT_FOUND without the map.
absl::StatusOr<uint64_t> SettleSessions(Engine& engine, SessionStore& sessions, std::string_view map);

}  // namespace mapkeep
