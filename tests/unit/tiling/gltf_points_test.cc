#include "core/tiling/gltf_points.h"

#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

namespace mapkeep {
namespace {

struct Glb {
  nlohmann::json json;
  std::string binary;
};

uint32_t NumberAt(const std::string& bytes, size_t at) {
  uint32_t number = 0;
  std::memcpy(&number, bytes.data() + at, 4);
  return number;
}

Glb Parse(const std::string& bytes) {
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(NumberAt(bytes, 4), 2U);
  EXPECT_EQ(NumberAt(bytes, 8), bytes.size());
  EXPECT_EQ(bytes.size() % 4, 0U);
  const uint32_t length = NumberAt(bytes, 12);
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  Glb glb{nlohmann::json::parse(bytes.substr(20, length)), {}};
  if (20 + length < bytes.size()) {
    EXPECT_EQ(NumberAt(bytes, 20 + length) + 28 + length, bytes.size());
    glb.binary = bytes.substr(28 + length);
  }
  return glb;
}

// The numbers of one attribute, a vertex behind the other.
std::vector<int> Column(const Glb& glb, const std::string& attribute) {
  const auto& accessor =
      glb.json["accessors"][glb.json["meshes"][0]["primitives"][0]["attributes"][attribute].get<int>()];
  const auto& view = glb.json["bufferViews"][accessor["bufferView"].get<int>()];
  const int width = accessor["type"] == "SCALAR" ? 1 : accessor["type"] == "VEC3" ? 3 : 4;
  std::vector<int> values;
  for (int i = 0; i < accessor["count"]; ++i) {
    for (int k = 0; k < width; ++k) {
      const size_t at = view["byteOffset"].get<size_t>() + i * view["byteStride"].get<size_t>();
      if (accessor["componentType"] == 5123) {
        uint16_t value = 0;
        std::memcpy(&value, glb.binary.data() + at + 2 * k, 2);
        values.push_back(value);
      } else if (accessor["componentType"] == 5120) {
        values.push_back(static_cast<int8_t>(glb.binary[at + k]));
      } else {
        values.push_back(static_cast<uint8_t>(glb.binary[at + k]));
      }
    }
  }
  return values;
}

// Where a viewer of 3D Tiles shows the points: the node's scale, rotation and translation, then y up to z up.
std::vector<double> Shown(const Glb& glb) {
  const auto& node = glb.json["nodes"][0];
  const std::vector<int> whole = Column(glb, "POSITION");
  const double scale = node["scale"][0];
  const std::vector<double> shift = node["translation"];
  std::vector<double> shown;
  for (size_t i = 0; i < whole.size(); i += 3) {
    const double x = scale * whole[i] + shift[0];
    const double y = scale * whole[i + 2] + shift[1];  // rotated by -90 degrees about x
    const double z = -scale * whole[i + 1] + shift[2];
    shown.insert(shown.end(), {x, -z, y});
  }
  return shown;
}

TEST(PointTile, PointsAreShownWhereTheyAre) {
  const std::vector<TilePoint> points = {{.x = -7, .y = 12, .z = 3}, {.x = 100, .y = -40, .z = 9}};
  const std::vector<double> shown = Shown(Parse(EncodePointTile(points, {.voxel_size = 0.2})));
  const std::vector<double> expected = {-0.325, 0.625, 0.175, 5.025, -1.975, 0.475};
  ASSERT_EQ(shown.size(), 6U);
  for (size_t i = 0; i < 6; ++i) EXPECT_NEAR(shown[i], expected[i], 1e-9);
}

TEST(PointTile, AcrossMoreThanSixteenBitsPointsKeepTheirPlaceToOneStep) {
  const std::vector<TilePoint> points = {{.x = 0}, {.x = 200001, .y = 5}, {.x = 77777, .z = -3}};
  const std::vector<double> shown = Shown(Parse(EncodePointTile(points, {.voxel_size = 0.2})));
  for (size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(shown[3 * i], (points[i].x + 0.5) * 0.05, 0.1);
    EXPECT_NEAR(shown[3 * i + 1], (points[i].y + 0.5) * 0.05, 0.1);
    EXPECT_NEAR(shown[3 * i + 2], (points[i].z + 0.5) * 0.05, 0.1);
  }
}

TEST(PointTile, AttributesAreWhatTheVoxelsKnow) {
  const std::vector<TilePoint> points = {
      {.x = 1, .normal = {128, 128}, .intensity = 40, .stability = 250, .first_seen_day = 100, .ground = true},
      {.x = 2, .normal = {255, 128}, .intensity = 41, .stability = 90, .first_seen_day = 9000},
      {.x = 3, .normal = {0, 0}}};
  const Glb glb = Parse(EncodePointTile(points, {.newest_day = 1000}));
  EXPECT_EQ(Column(glb, "_STABILITY"), (std::vector<int>{250, 90, 0}));
  EXPECT_EQ(Column(glb, "_AGE"), (std::vector<int>{900, 0, 1000}));
  EXPECT_EQ(Column(glb, "_GROUND"), (std::vector<int>{1, 0, 0}));
  EXPECT_EQ(Column(glb, "_INTENSITY"), (std::vector<int>{40, 41, 0}));
  EXPECT_EQ(Column(glb, "NORMAL"), (std::vector<int>{0, 0, 127, 127, 0, 0, 0, 0, 127}));
  EXPECT_FALSE(glb.json["meshes"][0]["primitives"][0]["attributes"].contains("_CLASS"));
}

TEST(PointTile, ChangesCarryTheirClass) {
  const std::vector<TilePoint> points(3);
  const std::vector<ChangeClass> classes = {ChangeClass::kUnstable, ChangeClass::kAppeared, ChangeClass::kDisappeared};
  const Glb glb = Parse(EncodePointTile(points, {.classes = classes}));
  EXPECT_EQ(Column(glb, "_CLASS"), (std::vector<int>{2, 0, 1}));
}

TEST(PointTile, NoPointsAreAnEmptyScene) {
  const Glb glb = Parse(EncodePointTile({}, {}));
  EXPECT_EQ(glb.json["scenes"].size(), 1U);
  EXPECT_FALSE(glb.json.contains("meshes"));
  EXPECT_TRUE(glb.binary.empty());
}

}  // namespace
}  // namespace mapkeep
