#include "core/tiling/gltf_points.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/tiling/point_colour.h"
#include "core/voxels/normal.h"

namespace mapkeep {
namespace {

constexpr int kUnsignedByte = 5121, kByte = 5120, kUnsignedShort = 5123;  // glTF's numbers for component types
constexpr uint32_t kGlbMagic = 0x46546c67, kGlbVersion = 2, kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;

void AppendLittleEndian(uint32_t value, std::string& out) {
  for (int byte = 0; byte < 4; ++byte) out.push_back(static_cast<char>(value >> (8 * byte) & 0xff));
}

// Header, JSON chunk, binary chunk (left out if there is nothing in it); each chunk padded to 4 bytes.
std::string Glb(std::string json, const std::string& binary) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const size_t padded = (binary.size() + 3) / 4 * 4;
  const size_t total = 12 + 8 + json.size() + (binary.empty() ? 0 : 8 + padded);
  std::string glb;
  glb.reserve(total);
  AppendLittleEndian(kGlbMagic, glb);
  AppendLittleEndian(kGlbVersion, glb);
  AppendLittleEndian(static_cast<uint32_t>(total), glb);
  AppendLittleEndian(static_cast<uint32_t>(json.size()), glb);
  AppendLittleEndian(kJsonChunk, glb);
  glb += json;
  if (binary.empty()) return glb;
  AppendLittleEndian(static_cast<uint32_t>(padded), glb);
  AppendLittleEndian(kBinaryChunk, glb);
  glb += binary;
  glb.resize(total, '\0');
  return glb;
}

// Where the mesh's whole numbers lie among the sub-voxels.
struct Frame {
  std::array<int32_t, 3> base{};
  std::array<uint32_t, 3> largest{};
  int shift = 0;
};

Frame FrameOf(std::span<const TilePoint> points) {
  Frame frame;
  frame.base = {points[0].x, points[0].y, points[0].z};
  std::array<int32_t, 3> high = frame.base;
  for (const TilePoint& point : points) {
    const std::array<int32_t, 3> at = {point.x, point.y, point.z};
    for (int axis = 0; axis < 3; ++axis) {
      frame.base[axis] = std::min(frame.base[axis], at[axis]);
      high[axis] = std::max(high[axis], at[axis]);
    }
  }
  const auto extent = [&](int axis) { return static_cast<uint32_t>(high[axis] - frame.base[axis]); };
  while ((std::max({extent(0), extent(1), extent(2)}) >> frame.shift) > std::numeric_limits<uint16_t>::max()) {
    ++frame.shift;
  }
  for (int axis = 0; axis < 3; ++axis) frame.largest[axis] = extent(axis) >> frame.shift;
  return frame;
}

// Every normal that two bytes can say, as three signed bytes.
const std::vector<std::array<int8_t, 3>>& NormalTable() {
  static const auto* const table = [] {
    auto* made = new std::vector<std::array<int8_t, 3>>(1 << 16);
    for (int code = 0; code < 1 << 16; ++code) {
      Eigen::Vector3d unit = DecodeNormal({static_cast<uint8_t>(code >> 8), static_cast<uint8_t>(code & 0xff)});
      if (unit.isZero()) unit = Eigen::Vector3d::UnitZ();
      for (int axis = 0; axis < 3; ++axis) (*made)[code][axis] = static_cast<int8_t>(std::lround(127 * unit[axis]));
    }
    return made;
  }();
  return *table;
}

// The columns of a mesh one behind the other, each a buffer view of its own: alike bytes side by side compress best.
// glTF wants elements at multiples of four bytes.
class Columns {
 public:
  explicit Columns(size_t count) : count_(count) {}

  /// The column's bytes, zeros, to be filled in at once. `rest` are further members of the accessor.
  char* Add(const char* attribute, int component, const char* type, int stride, const std::string& rest = {}) {
    const size_t begin = binary_.size();
    binary_.resize(begin + count_ * stride);
    absl::StrAppendFormat(&views_, R"(%s{"buffer":0,"byteOffset":%d,"byteLength":%d,"byteStride":%d,"target":34962})",
                          Comma(), begin, count_ * stride, stride);
    absl::StrAppendFormat(&accessors_, R"(%s{"bufferView":%d,"componentType":%d,"count":%d,"type":"%s"%s})", Comma(),
                          columns_, component, count_, type, rest);
    absl::StrAppendFormat(&attributes_, R"(%s"%s":%d)", Comma(), attribute, columns_);
    ++columns_;
    return binary_.data() + begin;
  }

  const std::string& binary() const { return binary_; }
  const std::string& views() const { return views_; }
  const std::string& accessors() const { return accessors_; }
  const std::string& attributes() const { return attributes_; }

 private:
  const char* Comma() const { return columns_ == 0 ? "" : ","; }

  const size_t count_;
  int columns_ = 0;
  std::string binary_, views_, accessors_, attributes_;
};

void PutShort(uint32_t value, char* to) {
  to[0] = static_cast<char>(value & 0xff);
  to[1] = static_cast<char>(value >> 8 & 0xff);
}

void AddPositions(std::span<const TilePoint> points, const Frame& frame, Columns& columns) {
  const std::string bounds =
      absl::StrFormat(R"(,"min":[0,0,0],"max":[%d,%d,%d])", frame.largest[0], frame.largest[1], frame.largest[2]);
  char* to = columns.Add("POSITION", kUnsignedShort, "VEC3", 8, bounds);
  for (const TilePoint& point : points) {
    PutShort(static_cast<uint32_t>(point.x - frame.base[0]) >> frame.shift, to);
    PutShort(static_cast<uint32_t>(point.y - frame.base[1]) >> frame.shift, to + 2);
    PutShort(static_cast<uint32_t>(point.z - frame.base[2]) >> frame.shift, to + 4);
    to += 8;
  }
}

constexpr std::array<std::array<uint8_t, 3>, 3> kClassColours = {{{30, 160, 80}, {205, 45, 55}, {235, 150, 20}}};

void AddColours(std::span<const TilePoint> points, const PointTileOptions& options, Columns& columns) {
  char* to = columns.Add("COLOR_0", kUnsignedByte, "VEC4", 4, R"(,"normalized":true)");
  for (size_t i = 0; i < points.size(); ++i) {
    const double height = (points[i].z + 0.5) * options.voxel_size / 4;
    const std::array<uint8_t, 3> colour = options.classes.empty()
                                              ? ColourAt(height, points[i].normal)
                                              : kClassColours[static_cast<size_t>(options.classes[i])];
    std::ranges::copy(colour, to);
    to[3] = static_cast<char>(0xff);
    to += 4;
  }
}

template <typename ValueOf>
void AddBytes(const char* attribute, std::span<const TilePoint> points, Columns& columns, const ValueOf& value) {
  char* to = columns.Add(attribute, kUnsignedByte, "SCALAR", 4);
  for (const TilePoint& point : points) {
    *to = static_cast<char>(value(point));
    to += 4;
  }
}

void AddAttributes(std::span<const TilePoint> points, const PointTileOptions& options, Columns& columns) {
  char* to = columns.Add("NORMAL", kByte, "VEC3", 4, R"(,"normalized":true)");
  const auto& normals = NormalTable();
  for (const TilePoint& point : points) {
    std::ranges::copy(normals[point.normal[0] << 8 | point.normal[1]], to);
    to += 4;
  }
  AddColours(points, options, columns);
  AddBytes("_STABILITY", points, columns, [](const TilePoint& point) { return point.stability; });
  to = columns.Add("_AGE", kUnsignedShort, "SCALAR", 4);
  for (const TilePoint& point : points) {
    PutShort(static_cast<uint32_t>(std::max(0, options.newest_day - point.first_seen_day)), to);
    to += 4;
  }
  AddBytes("_GROUND", points, columns, [](const TilePoint& point) { return point.ground ? 1 : 0; });
  AddBytes("_INTENSITY", points, columns, [](const TilePoint& point) { return point.intensity; });
  if (options.classes.empty()) return;
  to = columns.Add("_CLASS", kUnsignedByte, "SCALAR", 4);
  for (const ChangeClass change : options.classes) {
    *to = static_cast<char>(change);
    to += 4;
  }
}

constexpr char kAsset[] = R"("asset":{"version":"2.0","generator":"mapkeep"})";

}  // namespace

std::string EncodePointTile(std::span<const TilePoint> points, const PointTileOptions& options) {
  if (points.empty()) return Glb(absl::StrCat("{", kAsset, R"(,"scene":0,"scenes":[{}]})"), {});
  const Frame frame = FrameOf(points);
  Columns columns(points.size());
  AddPositions(points, frame, columns);
  AddAttributes(points, options, columns);

  const double edge = options.voxel_size / 4;
  const double unit = std::ldexp(edge, frame.shift);
  const double middle = std::ldexp(0.5, frame.shift);
  std::array<double, 3> corner;
  for (int axis = 0; axis < 3; ++axis) corner[axis] = (frame.base[axis] + middle) * edge;
  // The rotation takes (x, y, z) to (x, z, -y).
  std::string json =
      absl::StrFormat(R"({%s,"extensionsUsed":["KHR_mesh_quantization","KHR_materials_unlit"],)"
                      R"("extensionsRequired":["KHR_mesh_quantization"],"scene":0,"scenes":[{"nodes":[0]}],)"
                      R"("nodes":[{"mesh":0,"translation":[%.17g,%.17g,%.17g],)"
                      R"("rotation":[-0.7071067811865476,0,0,0.7071067811865476],"scale":[%.17g,%.17g,%.17g]}],)"
                      R"("materials":[{"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":1},)"
                      R"("extensions":{"KHR_materials_unlit":{}}}],)",
                      kAsset, corner[0], corner[2], -corner[1], unit, unit, unit);
  absl::StrAppend(&json, R"("meshes":[{"primitives":[{"mode":0,"material":0,"attributes":{)", columns.attributes(),
                  R"(}}]}],"accessors":[)", columns.accessors(), R"(],"bufferViews":[)", columns.views(),
                  R"(],"buffers":[{"byteLength":)", columns.binary().size(), "}]}");
  return Glb(std::move(json), columns.binary());
}

}  // namespace mapkeep
