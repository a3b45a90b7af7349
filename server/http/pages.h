#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <string>

#include "server/auth/authority.h"
#include "server/config.h"
#include "server/epoch_feed.h"
#include "server/http/asset_files.h"
#include "server/http/page.h"
#include "server/pipeline/session_feed.h"
#include "server/tiles/tile_source.h"
#include "server/work_pool.h"
#include "storage/map_store.h"
#include "storage/session_store.h"

namespace mapkeep {

/// What the pages work with; all of it outlives them, and the pool's work ends before them.
struct PageContext {
  MapStore& maps;
  SessionStore& sessions;
  SessionFeed& feed;
  EpochFeed& epochs;
  TileSource& tiles;
  const AssetFiles& assets;
  const Authority& authority;
  WorkPool& pool;  ///< of their own: whoever waits for a tile does not hold up an upload
  const Config& config;
};

// The interface over HTTP. JSON is that of the messages of proto/mapkeep/v1, field by field.
//
//   GET /                                                  the viewer's page
//   GET /viewer/...                                        its files
//   GET /v1/maps                                           {"maps": [Map], "nextPageToken"}; pageSize, pageToken
//   GET /v1/maps/{map}                                     Map at its newest epoch
//   GET /v1/maps/{map}/epochs?limit=                       {"epochs": [Version and "kind"]}, newest first
//   GET /v1/maps/{map}/latest/tileset.json                 3D Tiles of the newest epoch
//   GET /v1/maps/{map}/epochs/{epoch}/tileset.json         3D Tiles of an epoch
//   GET /v1/maps/{map}/epochs/{epoch}/tiles/{node}.glb     a tile; {node}.{id}.glb is as well answered, and says in its
//                                                          name what it holds: the same id, the same bytes
//   GET /v1/maps/{map}/epochs/{epoch}/tiles/{node}.json    a part of a large tileset
//   GET /v1/maps/{map}/changes/{a}/{b}                     {"appeared", "disappeared", "unstable"}, voxels
//   GET /v1/maps/{map}/changes/{a}/{b}/points.glb          their points
//   GET /v1/maps/{map}/sessions?pageSize=&pageToken=       ListSessionsResponse
//   GET /v1/maps/{map}/sessions/{id}                       Session
//   GET /v1/maps/{map}/sessions/{id}/poses?first=&pageSize=  ListScanPosesResponse
//   GET /v1/maps/{map}/voxel?x=&y=&z=&epoch=               QueryVoxelResponse
//   GET /v1/maps/{map}/events                              server-sent events: "epoch" (Version and "kind") now and
//   after
//                                                          each commit, "session" (Session) after each change
//
// An epoch that is collected is 410.
class Pages {
 public:
  explicit Pages(const PageContext& context) : context_(context) {}

  /// See PageHandler: does not block.
  void Handle(PageRequest request, Respond respond) const;

 private:
  using Work = std::function<absl::StatusOr<PageResponse>()>;
  void Answer(Respond respond, Work work) const;
  void HandleMap(PageRequest request, Respond respond) const;
  void HandleEpoch(PageRequest request, Respond respond) const;

  const PageContext context_;
};

}  // namespace mapkeep
