#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <memory>
#include <string>

#include "server/auth/authority.h"
#include "server/auth/certificates.h"
#include "server/config.h"
#include "server/epoch_feed.h"
#include "server/pipeline/session_feed.h"
#include "server/tiles/tile_source.h"
#include "storage/map_store.h"
#include "storage/session_store.h"

namespace mapkeep {

/// What pages show; all of it outlives them.
struct PageSubjects {
  MapStore& maps;
  SessionStore& sessions;
  SessionFeed& feed;
  EpochFeed& epochs;
  const Authority& authority;
  const Certificates* certificates = nullptr;  ///< nullptr: no TLS
};

/// Pages and tiles over HTTP, with threads, pool and caches of their own. See pages.h for what is served.
class PageService {
 public:
  /// Serves when it returns. UNAVAILABLE if the address cannot be had, NOT_FOUND if the viewer is not in a directory
  /// that the configuration names; that it is not beside the program is a warning.
  static absl::StatusOr<std::unique_ptr<PageService>> Start(const Config& config, const PageSubjects& subjects);
  ~PageService();

  int port() const;
  TileSourceCounts tile_counts() const;
  CacheUse tile_use() const;   ///< of tiles as they are sent
  CacheUse point_use() const;  ///< of the points that larger ones are made of
  size_t connections() const;  ///< open now
  uint64_t requests() const;   ///< since the start

  /// Lets answers under way end, at most for `patience`. The feeds must be closed before: streams of events end by
  /// that.
  void Stop(std::chrono::seconds patience);

 private:
  struct Parts;
  explicit PageService(std::unique_ptr<Parts> parts);

  std::unique_ptr<Parts> parts_;
};

}  // namespace mapkeep
