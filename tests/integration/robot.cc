#include "tests/integration/robot.h"

#include <gtest/gtest.h>

#include <chrono>

#include "core/checksum/crc32c.h"

namespace mapkeep {

WireScan Wire(uint32_t index, const Scan& scan, const Pose& pose) {
  WireScan wire;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    wire.bytes.append(reinterpret_cast<const char*>(scan.points[i].data()), 3 * sizeof(float));
    wire.bytes.append(reinterpret_cast<const char*>(&scan.intensities[i]), sizeof(float));
  }
  const PoseRows rows = RowsOf(pose);
  wire.header.set_index(index);
  wire.header.set_point_count(static_cast<uint32_t>(scan.points.size()));
  wire.header.mutable_pose()->mutable_rows()->Add(rows.begin(), rows.end());
  wire.header.set_time(scan.time);
  uint32_t crc = Crc32c(wire.bytes);
  crc = Crc32c({reinterpret_cast<const char*>(rows.data()), sizeof rows}, crc);
  wire.header.set_crc32c(Crc32c({reinterpret_cast<const char*>(&scan.time), sizeof scan.time}, crc));
  return wire;
}

std::vector<WireScan> Wire(const Drive& drive) {
  std::vector<WireScan> scans;
  for (uint32_t i = 0; i < drive.scans.size(); ++i) scans.push_back(Wire(i, drive.scans[i], drive.poses[i]));
  return scans;
}

Robot::Robot(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);  // no back-off left over from a daemon that was killed
  arguments.SetMaxReceiveMessageSize(8 << 20);
  channel_ = grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
  maps_ = v1::MapService::NewStub(channel_);
  sessions_ = v1::SessionService::NewStub(channel_);
  tiles_ = v1::TileService::NewStub(channel_);
  admin_ = v1::AdminService::NewStub(channel_);
}

std::unique_ptr<grpc::ClientContext> Robot::Call() {
  auto call = std::make_unique<grpc::ClientContext>();
  call->set_deadline(std::chrono::system_clock::now() + std::chrono::minutes(2));
  return call;
}

grpc::Status Robot::CreateMap(const std::string& map, double voxel_size) {
  v1::CreateMapRequest request;
  v1::CreateMapResponse response;
  request.set_name(map);
  request.set_voxel_size(voxel_size);
  return maps_->CreateMap(Call().get(), request, &response);
}

grpc::Status Robot::GetMap(const std::string& map, v1::Map& found) {
  v1::GetMapRequest request;
  v1::GetMapResponse response;
  request.set_name(map);
  const grpc::Status status = maps_->GetMap(Call().get(), request, &response);
  found = response.map();
  return status;
}

grpc::Status Robot::DeleteMap(const std::string& map) {
  v1::DeleteMapRequest request;
  v1::DeleteMapResponse response;
  request.set_name(map);
  return maps_->DeleteMap(Call().get(), request, &response);
}

grpc::Status Robot::Begin(const std::string& map, const std::string& id, const std::vector<WireScan>& scans,
                          v1::Session* session, bool keep_scans) {
  v1::BeginSessionRequest request;
  v1::BeginSessionResponse response;
  request.set_map(map);
  request.set_id(id);
  request.set_keep_scans(keep_scans);
  for (const WireScan& scan : scans) request.add_scan_crc32c(scan.header.crc32c());
  const grpc::Status status = sessions_->BeginSession(Call().get(), request, &response);
  if (session != nullptr) *session = response.session();
  return status;
}

std::unique_ptr<Robot::Upload> Robot::Open(grpc::ClientContext& call, const std::string& map, const std::string& id) {
  std::unique_ptr<Upload> upload = sessions_->UploadScans(&call);
  v1::UploadScansRequest request;
  request.mutable_open()->set_map(map);
  request.mutable_open()->set_id(id);
  upload->Write(request);
  return upload;
}

grpc::Status Robot::End(Upload& upload) {
  upload.WritesDone();
  v1::UploadScansResponse response;
  while (upload.Read(&response)) continue;
  return upload.Finish();
}

bool Robot::Send(Upload& upload, const WireScan& scan) {
  constexpr size_t kChunk = 100'000;
  v1::UploadScansRequest request;
  *request.mutable_scan() = scan.header;
  if (!upload.Write(request)) return false;
  for (size_t at = 0; at < scan.bytes.size(); at += kChunk) {
    request.set_chunk(scan.bytes.substr(at, kChunk));
    if (!upload.Write(request)) return false;
  }
  return true;
}

grpc::Status Robot::Send(const std::string& map, const std::string& id, const std::vector<WireScan>& scans) {
  const auto call = Call();
  const auto upload = Open(*call, map, id);
  bool whole = true;
  for (size_t i = 0; whole && i < scans.size(); ++i) whole = Send(*upload, scans[i]);
  return End(*upload);
}

grpc::Status Robot::Commit(const std::string& map, const std::string& id, v1::Session* session) {
  v1::CommitSessionRequest request;
  v1::CommitSessionResponse response;
  request.set_map(map);
  request.set_id(id);
  const grpc::Status status = sessions_->CommitSession(Call().get(), request, &response);
  if (session != nullptr) *session = response.session();
  return status;
}

grpc::Status Robot::GetSession(const std::string& map, const std::string& id, v1::Session& session) {
  v1::GetSessionRequest request;
  v1::GetSessionResponse response;
  request.set_map(map);
  request.set_id(id);
  const grpc::Status status = sessions_->GetSession(Call().get(), request, &response);
  session = response.session();
  return status;
}

grpc::Status Robot::DeleteSession(const std::string& map, const std::string& id) {
  v1::DeleteSessionRequest request;
  v1::DeleteSessionResponse response;
  request.set_map(map);
  request.set_id(id);
  return sessions_->DeleteSession(Call().get(), request, &response);
}

grpc::Status Robot::UploadDrive(const std::string& map, const std::string& id, const Drive& drive, bool keep_scans) {
  const std::vector<WireScan> scans = Wire(drive);
  if (grpc::Status status = Begin(map, id, scans, nullptr, keep_scans); !status.ok()) return status;
  if (grpc::Status status = Send(map, id, scans); !status.ok()) return status;
  return Commit(map, id);
}

v1::Session Robot::Watch(const std::string& map, const std::string& id,
                         const std::function<bool(const v1::Session&)>& enough) {
  v1::WatchSessionRequest request;
  v1::WatchSessionResponse response;
  request.set_map(map);
  request.set_id(id);
  const auto call = Call();
  const auto stream = sessions_->WatchSession(call.get(), request);
  while (stream->Read(&response)) {
    if (!enough || !enough(response.session())) continue;
    call->TryCancel();
    stream->Finish();
    return response.session();
  }
  const grpc::Status status = stream->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response.session();
}

std::vector<v1::VoxelBlock> Robot::Tiles(const std::string& map, bool include_all, const v1::Box* box) {
  v1::StreamTilesRequest request;
  request.set_map(map);
  request.set_include_all(include_all);
  if (box != nullptr) *request.mutable_box() = *box;
  return Tiles(request);
}

std::vector<v1::VoxelBlock> Robot::Tiles(const v1::StreamTilesRequest& request) {
  const auto call = Call();
  const auto stream = tiles_->StreamTiles(call.get(), request);
  std::vector<v1::VoxelBlock> blocks;
  v1::StreamTilesResponse response;
  while (stream->Read(&response)) {
    if (response.has_block()) blocks.push_back(response.block());
  }
  const grpc::Status status = stream->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  return blocks;
}

std::string BytesOf(const std::vector<v1::VoxelBlock>& blocks) {
  std::string bytes;
  for (const v1::VoxelBlock& block : blocks) bytes += block.SerializeAsString();
  return bytes;
}

const v1::VoxelBlock* FindBlock(const std::vector<v1::VoxelBlock>& blocks, const VoxelIndex& at) {
  for (const v1::VoxelBlock& block : blocks) {
    if (block.x() == at.x && block.y() == at.y && block.z() == at.z) return &block;
  }
  return nullptr;
}

}  // namespace mapkeep
