#include "client/exporters/glb.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/exporters/output_file.h"
#include "client/exporters/spooled_points.h"
#include "core/tiling/gltf_points.h"

namespace mapkeep {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is little-endian");

using Json = nlohmann::ordered_json;

constexpr size_t kPointsAMesh = size_t{1} << 16;
constexpr uint32_t kMagic = 0x46546c67, kVersion = 2, kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
constexpr size_t kFileHead = 12, kChunkHead = 8;

uint32_t NumberAt(std::string_view bytes, size_t at) {
  uint32_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof(number));
  return number;
}

/// Adds one tile's description to that of the whole, its numbers moved behind what is there.
void Append(Json tile, uint64_t binary_offset, Json* whole) {
  const size_t accessors = (*whole)["accessors"].size(), views = (*whole)["bufferViews"].size(),
               meshes = (*whole)["meshes"].size();
  for (Json& view : tile["bufferViews"]) {
    view["byteOffset"] = view.value("byteOffset", uint64_t{0}) + binary_offset;
    (*whole)["bufferViews"].push_back(std::move(view));
  }
  for (Json& accessor : tile["accessors"]) {
    accessor["bufferView"] = accessor["bufferView"].get<size_t>() + views;
    (*whole)["accessors"].push_back(std::move(accessor));
  }
  for (Json& mesh : tile["meshes"]) {
    for (Json& primitive : mesh["primitives"]) {
      for (auto& [name, index] : primitive["attributes"].items()) index = index.get<size_t>() + accessors;
    }
    (*whole)["meshes"].push_back(std::move(mesh));
  }
  for (Json& node : tile["nodes"]) {
    node["mesh"] = node["mesh"].get<size_t>() + meshes;
    (*whole)["scenes"][0]["nodes"].push_back((*whole)["nodes"].size());
    (*whole)["nodes"].push_back(std::move(node));
  }
}

class Glb final : public MapExporter {
 public:
  Glb(OutputFile file, SpooledPoints points, SpoolFile binary, const ExportedMap& map, const ExportOptions& options)
      : file_(std::move(file)), points_(std::move(points)), binary_(std::move(binary)), map_(map), options_(options) {}

  absl::Status Add(const Block& block) override {
    points_.See(block);
    AppendPoints(Selected(block, map_.voxel_size, options_), {.static_only = false}, waiting_);
    return waiting_.size() < kPointsAMesh ? absl::OkStatus() : Keep();
  }

  absl::Status Finish() override {
    if (!waiting_.empty()) {
      if (absl::Status status = Keep(); !status.ok()) return status;
    }
    Json whole;
    for (const SpooledPoints::Part& part : parts_) {
      const absl::StatusOr<std::vector<TilePoint>> points = points_.Read(part);
      if (!points.ok()) return points.status();
      if (absl::Status status = AddMesh(*points, &whole); !status.ok()) return status;
    }
    if (parts_.empty()) {
      file_.stream() << EncodePointTile({}, {.voxel_size = map_.voxel_size});
      return file_.Finish();
    }
    whole["buffers"] = Json::array({{{"byteLength", binary_.size()}}});
    return Write(whole.dump());
  }

 private:
  absl::Status Keep() {
    const absl::StatusOr<SpooledPoints::Part> part = points_.Add(waiting_);
    if (!part.ok()) return part.status();
    parts_.push_back(*part);
    count_ += waiting_.size();
    waiting_.clear();
    return absl::OkStatus();
  }

  /// Takes a tile apart: its description into `whole`, its columns behind the others.
  absl::Status AddMesh(const std::vector<TilePoint>& points, Json* whole) {
    const std::string tile =
        EncodePointTile(points, {.voxel_size = map_.voxel_size, .newest_day = points_.newest_day()});
    const uint32_t json_size = NumberAt(tile, kFileHead);
    Json description = Json::parse(std::string_view(tile).substr(kFileHead + kChunkHead, json_size));
    if (whole->empty()) {
      *whole = description;
      for (const char* list : {"accessors", "bufferViews", "meshes", "nodes"}) (*whole)[list] = Json::array();
      (*whole)["scenes"] = Json::array({{{"nodes", Json::array()}}});
    }
    Append(std::move(description), binary_.size(), whole);
    return binary_.Append(std::string_view(tile).substr(kFileHead + kChunkHead + json_size + kChunkHead));
  }

  absl::Status Write(std::string json) {
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const uint64_t total = kFileHead + 2 * kChunkHead + json.size() + binary_.size();
    if (total > std::numeric_limits<uint32_t>::max()) {
      return absl::OutOfRangeError(absl::StrFormat(
          "a glb file holds at most 4 GiB, %d points are more: cut with --box, or take 3dtiles", count_));
    }
    Put({kMagic, kVersion, static_cast<uint32_t>(total), static_cast<uint32_t>(json.size()), kJsonChunk});
    file_.stream() << json;
    Put({static_cast<uint32_t>(binary_.size()), kBinaryChunk});
    constexpr size_t kPiece = size_t{1} << 20;
    std::string piece(kPiece, '\0');
    for (uint64_t at = 0; at < binary_.size(); at += kPiece) {
      const size_t count = std::min<uint64_t>(kPiece, binary_.size() - at);
      if (absl::Status status = binary_.Read(at, piece.data(), count); !status.ok()) return status;
      file_.stream().write(piece.data(), static_cast<std::streamsize>(count));
    }
    return file_.Finish();
  }

  void Put(std::initializer_list<uint32_t> numbers) {
    for (const uint32_t number : numbers) file_.stream().write(reinterpret_cast<const char*>(&number), sizeof(number));
  }

  OutputFile file_;
  SpooledPoints points_;
  SpoolFile binary_;
  const ExportedMap map_;
  const ExportOptions options_;
  std::vector<TilePoint> waiting_;
  std::vector<SpooledPoints::Part> parts_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<MapExporter>> OpenGlb(const std::filesystem::path& path, const ExportedMap& map,
                                                     const ExportOptions& options) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  absl::StatusOr<SpooledPoints> points = SpooledPoints::Create(path);
  if (!points.ok()) return points.status();
  absl::StatusOr<SpoolFile> binary = SpoolFile::Create(path);
  if (!binary.ok()) return binary.status();
  return std::make_unique<Glb>(*std::move(file), *std::move(points), *std::move(binary), map, options);
}

}  // namespace mapkeep
