#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <string>
#include <vector>

#include "server/http/page.h"
#include "server/tiles/packing.h"
#include "server/tiles/tile_source.h"

namespace mapkeep {

/// The files of a bundled page, read and packed once, so that what is served is what was there at the start and no
/// request can name another file.
class AssetFiles {
 public:
  /// No files.
  AssetFiles() = default;
  /// Everything below the directory. NOT_FOUND without an index.html, RESOURCE_EXHAUSTED beyond 64 MiB, UNAVAILABLE for
  /// a file that cannot be read.
  static absl::StatusOr<AssetFiles> Read(const std::string& directory);

  /// The answer for the file at a path below the directory. 404 naming it if there is none.
  PageResponse Find(const PageRequest& request, const std::vector<std::string>& path) const;

  bool empty() const { return files_.empty(); }

 private:
  struct File {
    std::string content_type, tag;
    Keep keep = Keep::kRevalidate;
    std::map<Coding, SharedBytes> bodies;
  };
  std::map<std::string, File> files_;  // by path, with slashes
};

}  // namespace mapkeep
