#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "storage/engine.h"
#include "storage/map_rows.h"
#include "storage/session_codec.h"

namespace mapkeep {

/// NOT_FOUND, in words.
absl::Status NoSession(std::string_view map, std::string_view id);

/// The session's row. NOT_FOUND.
absl::StatusOr<StoredRow<StoredSession>> FindStored(const Engine& engine, std::string_view map, std::string_view id);

/// The record with its content. NOT_FOUND.
absl::StatusOr<SessionRecord> FindWhole(const Engine& engine, std::string_view map, std::string_view id);

/// A change to a session's row, with what is written beside it and what else must hold.
struct Change {
  StoredSession next;
  std::vector<Mutation> beside;
  bool deletes = false;
  std::vector<Condition> required;  ///< of other rows of the map's sessions
};
using ChangeMaker = std::function<absl::StatusOr<Change>(const StoredSession& found)>;

/// Changes a session by compare-and-set: `make` gives the change to the row as found, or why there is none, and is
/// asked again when another change came first.
absl::StatusOr<StoredSession> ChangeSession(Engine& engine, std::string_view map, std::string_view id,
                                            const ChangeMaker& make);

/// Gives a session that is about to be queued its turn, after every one that the map gave before.
absl::Status TakeTurn(const Engine& engine, std::string_view map, Change& change);

}  // namespace mapkeep
