#include <utility>

#include "client/mapkeep/client.h"
#include "client/mapkeep/connection.h"
#include "client/mapkeep/wire.h"

namespace mapkeep {
namespace {

constexpr size_t kVoxelsAMessage = size_t{1} << 14;  ///< about half a megabyte on the wire

}  // namespace

absl::StatusOr<MapInfo> Client::ImportMap(const NewMap& map,
                                          const std::function<absl::StatusOr<std::vector<Block>>()>& next) const {
  if (absl::Status reached = connection_->WaitForServer(); !reached.ok()) return reached;
  grpc::ClientContext context;
  v1::ImportMapResponse response;
  const auto stream = connection_->maps().ImportMap(&context, &response);
  v1::ImportMapRequest request;
  *request.mutable_header() = ToWire(map);
  bool open = stream->Write(request);
  size_t waiting = 0;
  const auto send = [&] {
    if (waiting > 0 && open) open = stream->Write(request);
    request.Clear();
    waiting = 0;
  };
  send();
  v1::ImportEnd end;
  absl::Status status;
  while (open) {
    const absl::StatusOr<std::vector<Block>> blocks = next();
    status = blocks.status();
    if (!status.ok() || blocks->empty()) break;
    for (const Block& block : *blocks) {
      *request.mutable_blocks()->add_blocks() = ToWire(block);
      waiting += block.voxels.size();
      end.set_blocks(end.blocks() + 1);
      end.set_voxels(end.voxels() + block.voxels.size());
      if (waiting >= kVoxelsAMessage) send();
    }
  }
  if (status.ok()) {
    send();
    *request.mutable_end() = end;
    if (open) stream->WriteLast(request, {});
  } else {
    context.TryCancel();
  }
  const absl::Status finished = connection_->StatusOf(stream->Finish());
  if (!status.ok()) return status;
  if (!finished.ok()) return finished;
  return FromWire(response.map());
}

}  // namespace mapkeep
