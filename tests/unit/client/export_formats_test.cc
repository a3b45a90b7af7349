#include <gtest/gtest.h>
#include <octomap/OcTree.h>
#include <pcl/io/pcd_io.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "client/archive/map_archive.h"
#include "client/exporters/map_exporter.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr double kVoxelSize = 0.2;
using Row = std::array<float, 4>;

/// Blocks on both sides of the origin, in order of key, of three tiles and two heights.
std::vector<Block> SomeMap() {
  std::mt19937_64 random(7);
  std::vector<Block> blocks;
  for (const VoxelIndex& at :
       {VoxelIndex{-1, -1, 0}, VoxelIndex{0, 0, -1}, VoxelIndex{0, 0, 0}, VoxelIndex{9, 2, 0}, VoxelIndex{9, -3, 1}}) {
    Block block{BlockKeyOf(at), {}};
    for (uint16_t position = static_cast<uint16_t>(random() % 50); position < 32768;
         position = static_cast<uint16_t>(position + 1 + random() % 60)) {
      block.voxels.push_back({.position = position,
                              .hits = static_cast<uint16_t>(8 + random() % 1000),
                              .exposures = static_cast<uint16_t>(random() % 1000),
                              .ground = random() % 3 == 0,
                              .is_static = random() % 4 != 0,
                              .is_new = random() % 8 == 0,
                              .mean = {static_cast<uint8_t>(random()), static_cast<uint8_t>(random()), 128},
                              .normal = {static_cast<uint8_t>(random()), static_cast<uint8_t>(random())},
                              .intensity = static_cast<uint8_t>(random()),
                              .mask = (random() & random() & random()) | 1,
                              .first_seen = 100,
                              .last_seen = static_cast<uint32_t>(100 + random() % 100)});
    }
    blocks.push_back(std::move(block));
  }
  std::ranges::sort(blocks, {}, &Block::key);
  return blocks;
}

std::multiset<Row> PointsOf(const std::vector<Block>& blocks, PointDetail detail) {
  std::multiset<Row> rows;
  for (const Block& block : blocks) {
    ForEachPoint(block, kVoxelSize, detail, {}, [&](const Eigen::Vector3d& point, const Voxel& voxel) {
      const Eigen::Vector3f p = point.cast<float>();
      rows.insert({p.x(), p.y(), p.z(), IntensityOf(voxel)});
    });
  }
  return rows;
}

class ExportFormatTest : public testing::Test {
 protected:
  ExportFormatTest() : directory_(fs::temp_directory_path() / ("mapkeep-export-" + std::to_string(::getpid()))) {
    fs::remove_all(directory_);
    fs::create_directories(directory_);
  }
  ~ExportFormatTest() override { fs::remove_all(directory_); }

  fs::path Write(const std::string& name, const std::string& format, const ExportOptions& options = {},
                 const ExportedMap& map = {.voxel_size = kVoxelSize}) {
    const auto which = ExportFormatOf(directory_ / name, format);
    EXPECT_TRUE(which.ok()) << which.status();
    auto exporter = OpenExporter(*which, directory_ / name, map, options);
    EXPECT_TRUE(exporter.ok()) << exporter.status();
    for (const Block& block : blocks_) {
      const absl::Status status = (*exporter)->Add(block);
      EXPECT_TRUE(status.ok()) << status;
    }
    EXPECT_FALSE(fs::exists(directory_ / name)) << "it appears only when it is whole";
    const absl::Status status = (*exporter)->Finish();
    EXPECT_TRUE(status.ok()) << status;
    count_ = (*exporter)->count();
    return directory_ / name;
  }

  /// By PCL, which also decompresses.
  static std::multiset<Row> ReadPcd(const fs::path& file) {
    pcl::PCLPointCloud2 cloud;
    EXPECT_EQ(pcl::PCDReader().read(file.string(), cloud), 0) << file;
    std::multiset<Row> rows;
    for (size_t i = 0; i < size_t{cloud.width} * cloud.height; ++i) {
      Row row;
      for (size_t field = 0; field < 4; ++field) {
        std::memcpy(&row[field], &cloud.data[i * cloud.point_step + cloud.fields[field].offset], 4);
      }
      rows.insert(row);
    }
    return rows;
  }

  const fs::path directory_;
  std::vector<Block> blocks_ = SomeMap();
  uint64_t count_ = 0;
};

TEST_F(ExportFormatTest, PclReadsPcdFilesPlainAndCompressed) {
  const std::multiset<Row> expected = PointsOf(blocks_, PointDetail::kSubVoxels);
  ASSERT_GT(expected.size(), 10'000U);
  EXPECT_EQ(ReadPcd(Write("plain.pcd", "")), expected);
  EXPECT_EQ(count_, expected.size());
  EXPECT_EQ(ReadPcd(Write("packed.pcd", "", {.compressed = true})), expected);
  EXPECT_LT(fs::file_size(directory_ / "packed.pcd"), fs::file_size(directory_ / "plain.pcd"));
  std::ifstream file(directory_ / "packed.pcd");
  const std::string text(std::istreambuf_iterator<char>(file), {});
  EXPECT_NE(text.find("DATA binary_compressed"), std::string::npos);
}

TEST_F(ExportFormatTest, ACompressedPcdOfManyPiecesIsOneStream) {
  blocks_.clear();
  for (int32_t x = 0; x < 20; ++x) {  // more than the 262,144 points of a piece
    Block block{BlockKeyOf(VoxelIndex{x, 0, 0}), {}};
    for (uint16_t p = 0; p < 2048; ++p)
      block.voxels.push_back({.position = p, .hits = 8, .mask = 0x1111'0000'1111'0000});
    blocks_.push_back(block);
  }
  std::ranges::sort(blocks_, {}, &Block::key);
  EXPECT_EQ(ReadPcd(Write("large.pcd", "", {.compressed = true})), PointsOf(blocks_, PointDetail::kSubVoxels));
}

TEST_F(ExportFormatTest, AutowareFindsEveryPointInTheCellThatItsMetadataSays) {
  const fs::path map = Write("autoware", "autoware");
  const YAML::Node metadata = YAML::LoadFile((map / "pointcloud_map_metadata.yaml").string());
  EXPECT_EQ(metadata["x_resolution"].as<float>(), 20.F);
  EXPECT_EQ(metadata["y_resolution"].as<float>(), 20.F);
  EXPECT_EQ(YAML::LoadFile((map / "map_projector_info.yaml").string())["projector_type"].as<std::string>(), "Local");
  std::multiset<Row> all;
  size_t cells = 0;
  for (const auto& entry : metadata) {
    const auto name = entry.first.as<std::string>();
    if (name == "x_resolution" || name == "y_resolution") continue;
    const auto corner = entry.second.as<std::vector<int>>();  // as Autoware's loader reads it
    ASSERT_EQ(corner.size(), 2U);
    const std::multiset<Row> points = ReadPcd(map / "pointcloud_map.pcd" / name);
    EXPECT_FALSE(points.empty()) << name;
    for (const Row& row : points) {
      ASSERT_TRUE(corner[0] <= row[0] && row[0] < corner[0] + 20 && corner[1] <= row[1] && row[1] < corner[1] + 20);
    }
    all.insert(points.begin(), points.end());
    ++cells;
  }
  EXPECT_EQ(all, PointsOf(blocks_, PointDetail::kSubVoxels));
  const fs::directory_iterator files(map / "pointcloud_map.pcd");
  EXPECT_EQ(static_cast<size_t>(std::distance(begin(files), end(files))), cells);
}

TEST_F(ExportFormatTest, ADirectoryThatHoldsSomethingIsNotWrittenOver) {
  fs::create_directories(directory_ / "full");
  std::ofstream(directory_ / "full" / "mine") << "x";
  const auto exporter = OpenExporter(ExportFormat::kAutoware, directory_ / "full", {.voxel_size = kVoxelSize}, {});
  EXPECT_EQ(exporter.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_TRUE(fs::exists(directory_ / "full" / "mine"));
}

/// Centres of the occupied leaves, in leaves.
std::set<std::array<int64_t, 3>> LeavesOf(const octomap::OcTree& tree) {
  std::set<std::array<int64_t, 3>> leaves;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    EXPECT_EQ(leaf.getDepth(), 16U) << "nothing is pruned";
    EXPECT_TRUE(tree.isNodeOccupied(*leaf));
    const auto index = [&](double c) { return static_cast<int64_t>(std::floor(c / tree.getResolution())); };
    leaves.insert({index(leaf.getX()), index(leaf.getY()), index(leaf.getZ())});
  }
  return leaves;
}

TEST_F(ExportFormatTest, OctoMapReadsEverySubVoxelAsALeaf) {
  octomap::OcTree tree(1.0);
  ASSERT_TRUE(tree.readBinary(Write("map.bt", "").string()));
  EXPECT_DOUBLE_EQ(tree.getResolution(), kVoxelSize / 4);
  std::set<std::array<int64_t, 3>> expected;
  size_t nodes = 0;
  for (const Block& block : blocks_) {
    ForEachPoint(block, kVoxelSize, PointDetail::kSubVoxels, {}, [&](const Eigen::Vector3d& point, const Voxel&) {
      const auto index = [](double c) { return static_cast<int64_t>(std::floor(c / (kVoxelSize / 4))); };
      expected.insert({index(point.x()), index(point.y()), index(point.z())});
    });
  }
  EXPECT_EQ(LeavesOf(tree), expected);
  EXPECT_EQ(count_, expected.size());
  for (auto node = tree.begin_tree(); node != tree.end_tree(); ++node) ++nodes;
  EXPECT_EQ(tree.size(), nodes);
  // The header announces as many.
  std::ifstream file(directory_ / "map.bt");
  std::string line;
  while (std::getline(file, line) && !line.starts_with("size")) continue;
  EXPECT_EQ(line, "size " + std::to_string(nodes));
}

TEST_F(ExportFormatTest, OctoMapLeavesCanBeVoxels) {
  octomap::OcTree tree(1.0);
  ASSERT_TRUE(tree.readBinary(Write("map.bt", "", {.detail = PointDetail::kCentroids}).string()));
  EXPECT_DOUBLE_EQ(tree.getResolution(), kVoxelSize);
  size_t voxels = 0;
  for (const Block& block : blocks_) voxels += block.voxels.size();
  EXPECT_EQ(LeavesOf(tree).size(), voxels);
}

TEST_F(ExportFormatTest, WhatOctoMapCannotReachIsRefused) {
  auto exporter = OpenExporter(ExportFormat::kOctoMap, directory_ / "far.bt", {.voxel_size = kVoxelSize}, {});
  ASSERT_TRUE(exporter.ok());
  const Block far{BlockKeyOf(VoxelIndex{256, 0, 0}), {{.position = 0, .hits = 8, .mask = 1}}};
  EXPECT_EQ((*exporter)->Add(far).code(), absl::StatusCode::kOutOfRange) << "1,638.4 m";
  exporter->reset();
  EXPECT_TRUE(fs::is_empty(directory_));
}

TEST_F(ExportFormatTest, AnArchiveGivesEveryBlockBackAndIsTheSameBytesAgain) {
  const ExportedMap map{.voxel_size = kVoxelSize, .origin = Eigen::Vector3d(1e6, -2, 0.1), .crs = "EPSG:25832"};
  const fs::path file = Write("map.mkmap", "", {}, map);
  auto reader = ArchiveReader::Open(file);
  ASSERT_TRUE(reader.ok()) << reader.status();
  EXPECT_EQ(reader->header(), (ArchiveHeader{map.voxel_size, map.origin, map.crs}));
  std::vector<Block> read;
  while (true) {
    const auto blocks = reader->Next();
    ASSERT_TRUE(blocks.ok()) << blocks.status();
    if (blocks->empty()) break;
    read.insert(read.end(), blocks->begin(), blocks->end());
  }
  EXPECT_EQ(read, blocks_);
  const auto bytes = [](const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  EXPECT_EQ(bytes(file), bytes(Write("again.mkmap", "", {}, map)));
}

TEST_F(ExportFormatTest, DamageToAnArchiveIsFoundWhereverItIs) {
  const fs::path file = Write("map.mkmap", "");
  std::ifstream stream(file, std::ios::binary);
  const std::string whole(std::istreambuf_iterator<char>(stream), {});
  const auto read_all = [&](const std::string& bytes) -> absl::Status {
    std::ofstream(directory_ / "bad.mkmap", std::ios::binary) << bytes;
    auto reader = ArchiveReader::Open(directory_ / "bad.mkmap");
    if (!reader.ok()) return reader.status();
    while (true) {
      const auto blocks = reader->Next();
      if (!blocks.ok()) return blocks.status();
      if (blocks->empty()) return absl::OkStatus();
    }
  };
  ASSERT_TRUE(read_all(whole).ok());
  for (size_t at = 0; at < whole.size(); at += 1 + whole.size() / 300) {
    std::string bad = whole;
    bad[at] = static_cast<char>(bad[at] ^ 0x20);
    EXPECT_FALSE(read_all(bad).ok()) << "byte " << at;
    EXPECT_FALSE(read_all(whole.substr(0, at)).ok()) << "cut at " << at;
  }
  EXPECT_FALSE(read_all(whole + "x").ok());
}

TEST_F(ExportFormatTest, ABoxCutsPointsOfEveryFormat) {
  const Eigen::AlignedBox3d box(Eigen::Vector3d(-3, -3, -10), Eigen::Vector3d(2, 3, 10));
  const std::multiset<Row> all = PointsOf(blocks_, PointDetail::kSubVoxels);
  const size_t inside = std::ranges::count_if(
      all, [&](const Row& row) { return box.contains(Eigen::Vector3f(row[0], row[1], row[2]).cast<double>()); });
  ASSERT_TRUE(inside > 0 && inside < all.size());
  for (const ExportFormatInfo& info : ExportFormats()) {
    if (info.whole_voxels) continue;
    Write(std::string("cut-") + std::string(info.name), std::string(info.name), {.box = box});
    EXPECT_EQ(count_, inside) << info.name;
  }
}

TEST_F(ExportFormatTest, AnEmptyMapIsAWholeFileOfEveryFormat) {
  blocks_.clear();
  for (const ExportFormatInfo& info : ExportFormats()) {
    Write(std::string("empty-") + std::string(info.name), std::string(info.name));
    EXPECT_EQ(count_, 0U) << info.name;
  }
  octomap::OcTree tree(1.0);
  EXPECT_TRUE(tree.readBinary((directory_ / "empty-bt").string()));
  EXPECT_EQ(tree.size(), 0U);
}

TEST_F(ExportFormatTest, WhatAFormatDoesNotHaveIsRefused) {
  const ExportedMap map{.voxel_size = kVoxelSize};
  const auto code = [&](ExportFormat format, const ExportOptions& options, const ExportedMap& of) {
    return OpenExporter(format, directory_ / "x", of, options).status().code();
  };
  EXPECT_EQ(code(ExportFormat::kPly, {.compressed = true}, map), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(ExportFormat::kAutoware, {.absolute = true}, map), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(ExportFormat::kOctoMap, {.absolute = true}, map), absl::StatusCode::kInvalidArgument);
  ExportedMap geographic = map;
  geographic.crs = "EPSG:4326";
  EXPECT_EQ(code(ExportFormat::kLas, {}, geographic), absl::StatusCode::kFailedPrecondition) << "degrees";
  geographic.crs = "EPSG:999999";
  EXPECT_EQ(code(ExportFormat::kLas, {}, geographic), absl::StatusCode::kFailedPrecondition) << "no such system";
  EXPECT_FALSE(ExportFormatOf("map.xyz", "").ok());
  EXPECT_FALSE(ExportFormatOf("map.pcd", "xyz").ok());
  EXPECT_TRUE(fs::is_empty(directory_));
}

}  // namespace
}  // namespace mapkeep
