#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <string_view>
#include <vector>

namespace mapkeep {

/// The files of `folder` with this extension, in order of scan: names that are numbers by their value, however many
/// digits they have, then the others by name. NOT_FOUND if there is none.
absl::StatusOr<std::vector<std::filesystem::path>> ListScanFiles(const std::filesystem::path& folder,
                                                                 std::string_view extension);

}  // namespace mapkeep
