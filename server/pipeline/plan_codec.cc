#include "server/pipeline/plan_codec.h"

#include <bit>

#include "storage/byte_planes.h"
#include "storage/zstd.h"

namespace mapkeep {
namespace {

constexpr char kMagic = 'P', kVersion = 1;
constexpr size_t kWallsAt = 2, kFloorsAt = 6, kFrameAt = 10;
constexpr size_t kBytesPerWall = 10, kBytesPerFloor = 12;
constexpr uint64_t kMostCells = uint64_t{1} << 20;  // of a tile, far beyond what fits into one
constexpr int kZstdLevel = 3;

template <typename Cell>
void AppendPlaces(const std::vector<Cell>& cells, std::string& out) {
  AppendPlanes<4>(out, cells.size(), [&](size_t i) {
    return static_cast<uint32_t>(cells[i].y) - (i == 0 ? 0U : static_cast<uint32_t>(cells[i - 1].y));
  });
  AppendPlanes<4>(out, cells.size(), [&](size_t i) { return static_cast<uint32_t>(cells[i].x); });
}

template <typename Cell>
const char* ReadPlaces(const char* columns, std::vector<Cell>& cells) {
  uint32_t y = 0;
  columns = ReadPlanes<4>(columns, cells.size(), [&](size_t i, uint64_t step) {
    y += static_cast<uint32_t>(step);
    cells[i].y = static_cast<int32_t>(y);
  });
  return ReadPlanes<4>(columns, cells.size(),
                       [&](size_t i, uint64_t x) { cells[i].x = static_cast<int32_t>(static_cast<uint32_t>(x)); });
}

}  // namespace

absl::StatusOr<std::string> EncodePlan(const PlanPart& plan) {
  std::string bytes{kMagic, kVersion};
  AppendNumber<4>(bytes, plan.walls.size());
  AppendNumber<4>(bytes, plan.floors.size());
  Parts parts;
  AppendPlaces(plan.walls, parts.bytes);
  AppendPlanes<2>(parts.bytes, plan.walls.size(), [&](size_t i) { return plan.walls[i].facings; });
  parts.Cut();
  AppendPlaces(plan.floors, parts.bytes);
  AppendPlanes<4>(parts.bytes, plan.floors.size(),
                  [&](size_t i) { return std::bit_cast<uint32_t>(plan.floors[i].height); });
  parts.Cut();
  const absl::StatusOr<std::string> frame = Compress(parts, kZstdLevel);
  if (!frame.ok()) return frame.status();
  return bytes + *frame;
}

absl::StatusOr<PlanPart> DecodePlan(std::string_view bytes) {
  if (bytes.size() < kFrameAt || bytes[0] != kMagic || bytes[1] != kVersion) {
    return absl::DataLossError("not a plan of version 1");
  }
  const uint64_t walls = NumberAt<4>(bytes.data() + kWallsAt), floors = NumberAt<4>(bytes.data() + kFloorsAt);
  if (walls > kMostCells || floors > kMostCells) return absl::DataLossError("a plan of more cells than a tile has");
  const absl::StatusOr<std::string> columns =
      Decompress(bytes.substr(kFrameAt), walls * kBytesPerWall + floors * kBytesPerFloor);
  if (!columns.ok()) return columns.status();
  PlanPart plan;
  plan.walls.resize(walls);
  plan.floors.resize(floors);
  const char* at = ReadPlaces(columns->data(), plan.walls);
  at = ReadPlanes<2>(at, walls, [&](size_t i, uint64_t facings) { plan.walls[i].facings = facings; });
  at = ReadPlaces(at, plan.floors);
  ReadPlanes<4>(at, floors, [&](size_t i, uint64_t height) {
    plan.floors[i].height = std::bit_cast<float>(static_cast<uint32_t>(height));
  });
  return plan;
}

}  // namespace mapkeep
