#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/geometry/progress.h"
#include "storage/engine.h"

namespace mapkeep {

/// Copies a map from one engine to another (or to the same one under another name) and makes it known there in one last
/// step: whoever looks sees no map or a whole one. ALREADY_EXISTS if `to` has a map `as`, NOT_FOUND if `from` has no
/// map `map`, errors of damaged values are passed on. What a copy that was broken off leaves is collected.
/// - With `epoch`: the map as of that epoch, with its commit records and applied sessions, and nothing that came later.
///   `from` may be served meanwhile if the epoch is pinned or tagged.
/// - Without: all readable epochs, tags, and the sessions with their scans and poses. Nobody may write to `from`
///   meanwhile: it is a checkpoint.
absl::Status CopyMap(const Engine& from, Engine& to, std::string_view map, std::string_view as,
                     std::optional<uint64_t> epoch = {}, const Progress& progress = {});

/// Copies the newest state of a map from one engine to another as the first epoch of a new map `as`, made by one commit
/// of `session`; its history stays behind. Otherwise as CopyMap.
absl::Status AdoptMap(const Engine& from, Engine& to, std::string_view map, std::string_view as,
                      std::string_view session, const Progress& progress = {});

/// Names of the maps in an engine, in order.
absl::StatusOr<std::vector<std::string>> MapNames(const Engine& engine);

}  // namespace mapkeep
