#include "core/tiling/tileset_json.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

namespace mapkeep {
namespace {

std::vector<TileNode> Tree() {
  std::vector<TileColumn> columns;
  for (int x = 0; x < 4; ++x) {
    for (int y = 0; y < 4; ++y) columns.push_back({ColumnOf(BlockKeyOf({x, y, 0})), 5000, -1, x});
  }
  std::ranges::sort(columns, {}, &TileColumn::key);
  return BuildTileTree(columns);
}

TilesetOptions Options() {
  return {.voxel_size = 0.2, .tile_uri = [](const TileNode& node) { return "tiles/" + NameOf(node.id) + ".glb"; }};
}

TEST(TilesetJson, ListsTheWholeTree) {
  const std::vector<TileNode> tree = Tree();
  const auto json = nlohmann::json::parse(TilesetJson(tree, 0, Options()));
  EXPECT_EQ(json["asset"]["version"], "1.1");
  const auto& root = json["root"];
  EXPECT_EQ(root["content"]["uri"], "tiles/2_0_0.glb");
  EXPECT_EQ(root["refine"], "ADD");
  EXPECT_EQ(root["children"].size(), 4U);
  EXPECT_EQ(root["children"][3]["children"].size(), 4U);
  EXPECT_DOUBLE_EQ(root["geometricError"], 8 * 0.2);
  EXPECT_DOUBLE_EQ(root["children"][0]["geometricError"], 8 * 0.1);
  EXPECT_DOUBLE_EQ(root["children"][0]["children"][0]["geometricError"], 0);
  // 25.6 m square, from one block below zero to the fourth above.
  const std::vector<double> box = root["boundingVolume"]["box"];
  EXPECT_EQ(box, (std::vector<double>{12.8, 12.8, 9.6, 12.8, 0, 0, 0, 12.8, 0, 0, 0, 16}));
  EXPECT_GE(json["geometricError"].get<double>(), root["geometricError"].get<double>());
}

TEST(TilesetJson, DeepTreesAreDividedAmongFiles) {
  const std::vector<TileNode> tree = Tree();
  TilesetOptions options = Options();
  options.tileset_uri = [](const TileNode& node) { return NameOf(node.id) + ".json"; };
  const auto json = nlohmann::json::parse(TilesetJson(tree, 0, options));
  const auto& child = json["root"]["children"][1];
  EXPECT_EQ(child["content"]["uri"], "1_1_0.json");
  EXPECT_FALSE(child.contains("children"));
  const auto below = nlohmann::json::parse(TilesetJson(tree, tree[0].children[1], options));
  EXPECT_EQ(below["root"]["content"]["uri"], "tiles/1_1_0.glb");
  EXPECT_EQ(below["root"]["children"].size(), 4U);
  EXPECT_EQ(below["root"]["geometricError"], child["geometricError"]);
}

TEST(TilesetJson, CarriesExtras) {
  TilesetOptions options = Options();
  options.extras = R"({"mapkeep":{"epoch":3}})";
  EXPECT_EQ(nlohmann::json::parse(TilesetJson(Tree(), 0, options))["extras"]["mapkeep"]["epoch"], 3);
}

TEST(TilesetJson, AnEmptyMapIsATilesetWithNothingToShow) {
  const auto json = nlohmann::json::parse(TilesetJson({}, 0, Options()));
  EXPECT_FALSE(json["root"].contains("content"));
  EXPECT_EQ(json["root"]["boundingVolume"]["box"].size(), 12U);
}

}  // namespace
}  // namespace mapkeep
