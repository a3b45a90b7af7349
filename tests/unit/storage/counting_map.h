#pragma once

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "storage/map_rows.h"
#include "storage/map_store.h"
#include "tests/unit/storage/status_matchers.h"

namespace mapkeep {

// Sessions that count: session k adds one to a voxel in each of three blocks, so that a session that was merged twice,
// or on top of an older head, shows in the sums.

inline std::vector<BlockKey> CountedBlocks(int session) {
  std::set<BlockKey> keys;
  for (const int i : {session, 3 * session + 1, 7 * session + 2}) {
    keys.insert(BlockKeyOf(VoxelIndex{i % 11, i % 7, i % 2}));
  }
  return {keys.begin(), keys.end()};
}

inline CommitRequest CountingRequest(int session) {
  return {.session = std::to_string(session), .blocks = [session](const Snapshot& head) {
            absl::StatusOr<std::vector<Block>> blocks = std::vector<Block>();
            for (const BlockKey key : CountedBlocks(session)) {
              const auto before = head.Read(key);
              if (!before.ok()) return absl::StatusOr<std::vector<Block>>(before.status());
              Block block = *before == nullptr ? Block{key, {{.position = 1}}} : **before;
              ++block.voxels[0].hits;
              // Content that differs from session to session, also where the count is equal.
              block.voxels[0].mask = block.voxels[0].mask * 31 + static_cast<uint64_t>(session);
              blocks->push_back(block);
            }
            return blocks;
          }};
}

inline uint64_t CountIn(const Snapshot& snapshot, BlockKey key) {
  const auto block = snapshot.Read(key);
  EXPECT_DONE(block);
  return block.ok() && *block != nullptr ? (*block)->voxels[0].hits : 0;
}

/// Whether the head holds exactly these sessions, each once.
inline void ExpectCounted(const MapStore& maps, const std::set<int>& sessions) {
  std::map<BlockKey, uint64_t> expected;
  for (const int session : sessions) {
    for (const BlockKey key : CountedBlocks(session)) ++expected[key];
  }
  const auto snapshot = maps.Open("m");
  ASSERT_DONE(snapshot);
  EXPECT_EQ((*snapshot)->sessions(), sessions.size());
  EXPECT_EQ((*snapshot)->epoch(), sessions.size());
  EXPECT_EQ((*snapshot)->totals().blocks, expected.size());
  for (const auto& [key, count] : expected) EXPECT_EQ(CountIn(**snapshot, key), count);
}

/// Every value that the tree at `root` reaches; reads and checks each.
inline void Reach(const MapValues& values, const ValueName& name, std::set<ValueName>& reached) {
  if (!reached.insert(name).second) return;
  if (name.kind == ValueKind::kBlock) {
    ASSERT_DONE(values.ReadBlock(name));
    return;
  }
  const auto node = values.ReadNode(name);
  ASSERT_DONE(node);
  for (const TreeChild& child : (*node)->children) {
    Reach(values, NameOfChild((*node)->level, (*node)->prefix, child), reached);
  }
}

/// Whether every epoch that may be opened reads whole, and how many values are stored that none of them reaches.
inline size_t CheckMap(const Engine& engine, uint64_t incarnation) {
  MapCaches caches(0);
  const MapValues values(engine, caches, incarnation);
  std::set<ValueName> reached;
  EXPECT_DONE(engine.Scan(HeadPartition(incarnation), "root/", "root0", [&](std::string_view, std::string_view row) {
    const auto state = DecodeEpoch(row);
    EXPECT_DONE(state);
    if (state.ok() && state->root) Reach(values, NameOfRoot(*state->root), reached);
    return true;
  }));
  std::set<std::pair<std::string, std::string>> keys;
  for (const ValueName& name : reached) keys.emplace(GroupOf(incarnation, name), KeyOf(name));
  std::set<std::string> groups = {TreeGroup(incarnation)};
  for (int x = 0; x < 11; ++x) {
    for (int y = 0; y < 7; ++y) groups.insert(TileGroup(incarnation, TileKeyOf(BlockKeyOf(VoxelIndex{x, y, 0}))));
  }
  size_t stored = 0;
  for (const std::string& group : groups) {
    EXPECT_DONE(engine.ScanValueKeys(group, "", "", [&](std::string_view key) {
      stored += keys.contains({group, std::string(key)}) ? 0 : 1;
      return true;
    }));
  }
  return stored;
}

}  // namespace mapkeep
