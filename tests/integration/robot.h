#pragma once

#include <grpcpp/grpcpp.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/voxels/block.h"
#include "mapkeep/v1/admin_service.grpc.pb.h"
#include "mapkeep/v1/map_service.grpc.pb.h"
#include "mapkeep/v1/session_service.grpc.pb.h"
#include "mapkeep/v1/tile_service.grpc.pb.h"
#include "tests/integration/scene.h"

namespace mapkeep {

/// A scan as the wire carries it: header with checksum, and the bytes of its points.
struct WireScan {
  v1::ScanHeader header;
  std::string bytes;
};

/// With the checksum that its content has.
WireScan Wire(uint32_t index, const Scan& scan, const Pose& pose);
std::vector<WireScan> Wire(const Drive& drive);

/// A client that speaks the protocol by hand, for tests that want to break it.
class Robot {
 public:
  using Upload = grpc::ClientReaderWriter<v1::UploadScansRequest, v1::UploadScansResponse>;

  /// Every call ends after two minutes at the latest.
  explicit Robot(const std::string& address);

  static std::unique_ptr<grpc::ClientContext> Call();

  grpc::Status CreateMap(const std::string& map, double voxel_size = 0);
  grpc::Status GetMap(const std::string& map, v1::Map& found);
  grpc::Status DeleteMap(const std::string& map);

  grpc::Status Begin(const std::string& map, const std::string& id, const std::vector<WireScan>& scans,
                     v1::Session* session = nullptr, bool keep_scans = false);
  /// Sends `open`; the answer is not read.
  std::unique_ptr<Upload> Open(grpc::ClientContext& call, const std::string& map, const std::string& id);
  /// The client's end, then what was answered, then the status.
  static grpc::Status End(Upload& upload);
  /// Header and chunks; false once the stream is broken.
  static bool Send(Upload& upload, const WireScan& scan);
  /// The whole of an upload: open, these scans, the end.
  grpc::Status Send(const std::string& map, const std::string& id, const std::vector<WireScan>& scans);
  grpc::Status Commit(const std::string& map, const std::string& id, v1::Session* session = nullptr);
  grpc::Status GetSession(const std::string& map, const std::string& id, v1::Session& session);
  grpc::Status DeleteSession(const std::string& map, const std::string& id);

  /// Begin, send and commit.
  grpc::Status UploadDrive(const std::string& map, const std::string& id, const Drive& drive, bool keep_scans = false);

  /// Watches the session until `enough` says so or it has ended; gives what was seen last.
  v1::Session Watch(const std::string& map, const std::string& id,
                    const std::function<bool(const v1::Session&)>& enough = {});

  /// The whole stream; fails the test if it does not end well.
  std::vector<v1::VoxelBlock> Tiles(const std::string& map, bool include_all, const v1::Box* box = nullptr);
  std::vector<v1::VoxelBlock> Tiles(const v1::StreamTilesRequest& request);

  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  v1::MapService::Stub& maps() { return *maps_; }
  v1::SessionService::Stub& sessions() { return *sessions_; }
  v1::TileService::Stub& tiles() { return *tiles_; }
  v1::AdminService::Stub& admin() { return *admin_; }

 private:
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::MapService::Stub> maps_;
  std::unique_ptr<v1::SessionService::Stub> sessions_;
  std::unique_ptr<v1::TileService::Stub> tiles_;
  std::unique_ptr<v1::AdminService::Stub> admin_;
};

/// All columns of all blocks, to compare streams byte by byte.
std::string BytesOf(const std::vector<v1::VoxelBlock>& blocks);

/// The stream's only or missing block at a place.
const v1::VoxelBlock* FindBlock(const std::vector<v1::VoxelBlock>& blocks, const VoxelIndex& at);

}  // namespace mapkeep
