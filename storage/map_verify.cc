#include <absl/container/flat_hash_set.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "storage/map_store_state.h"
#include "storage/sealed_history.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr size_t kMostProblems = 100;

/// One check of one map. What is stored is listed before the rows that explain it are read: a value that comes between
/// is announced, one that goes between is looked for once more before it counts as left behind.
class Verifier {
 public:
  using StoredValue = std::pair<std::string, std::string>;  ///< group and key

  Verifier(const Engine& engine, uint64_t incarnation, const std::function<absl::Status(const Block&)>& block)
      : engine_(engine),
        incarnation_(incarnation),
        partition_(HeadPartition(incarnation)),
        caches_(0),
        values_(engine, caches_, incarnation),
        block_(block) {}

  absl::StatusOr<MapVerification> Run(const Progress& progress) {
    if (absl::Status status = ListStored(); !status.ok()) return status;
    if (absl::Status status = CollectNamed(); !status.ok()) return status;
    if (absl::Status status = ReadEpochs(progress); !status.ok()) return status;
    if (absl::Status status = FindLeftBehind(); !status.ok()) return status;
    return std::move(found_);
  }

 private:
  absl::Status ForEachRow(std::string_view prefix, const std::function<absl::Status(std::string_view)>& visit) const {
    absl::Status visited;
    const absl::Status scanned =
        engine_.Scan(partition_, prefix, EndOf(prefix), [&](std::string_view, std::string_view bytes) {
          visited = visit(bytes);
          return visited.ok();
        });
    return scanned.ok() ? visited : scanned;
  }

  absl::Status ListStored() {
    std::set<std::string> groups = {TreeGroup(incarnation_)};
    absl::Status status = ForEachCommit(engine_, incarnation_, [&](const CommitRecord& commit) {
      for (const TileKey tile : commit.touched_tiles) groups.insert(TileGroup(incarnation_, tile));
      return absl::OkStatus();
    });
    for (auto group = groups.begin(); status.ok() && group != groups.end(); ++group) {
      status = engine_.ScanValueKeys(*group, "", "", [&](std::string_view key) {
        stored_.emplace_back(*group, key);
        return true;
      });
    }
    return status;
  }

  void Know(const std::vector<ValueName>& names) {
    for (const ValueName& name : names) Know(name);
  }

  void Know(const ValueName& name) {
    known_.emplace(GroupOf(incarnation_, name), KeyOf(name));
    if (name.kind == ValueKind::kLeaf) Know(DerivedFrom(name));
  }

  absl::Status CollectNamed() {
    absl::Status status = ForEachRow("staged/", [this](std::string_view bytes) {
      const absl::StatusOr<Staged> staged = DecodeStaged(bytes);
      if (staged.ok()) Know(staged->values);
      return staged.status();
    });
    if (!status.ok()) return status;
    return ForEachRow("superseded/", [this](std::string_view bytes) {
      const absl::StatusOr<Superseded> superseded = DecodeSuperseded(bytes);
      if (superseded.ok()) Know(superseded->names);
      return superseded.status();
    });
  }

  absl::Status ReadEpochs(const Progress& progress) {
    std::vector<EpochState> epochs;
    absl::Status status = ForEachRow("root/", [&epochs](std::string_view bytes) {
      const absl::StatusOr<EpochState> epoch = DecodeEpoch(bytes);
      if (epoch.ok()) epochs.push_back(*epoch);
      return epoch.status();
    });
    if (!status.ok()) return status;
    for (size_t i = 0; i < epochs.size(); ++i) {
      if (progress && !progress(static_cast<double>(i) / static_cast<double>(epochs.size()))) {
        return absl::CancelledError("the check was stopped");
      }
      ++found_.epochs;
      if (epochs[i].root) Check(kRootLevel, 0, *epochs[i].root, epochs[i].epoch);
    }
    return absl::OkStatus();
  }

  /// The value that a parent's entry names, and what is below it.
  void Check(int level, uint64_t prefix, const TreeChild& entry, uint64_t epoch) {
    const ValueName name{level < 0 ? ValueKind::kBlock : static_cast<ValueKind>(level), prefix, entry.written};
    const auto [before, first] = checked_.emplace(name, entry.totals);
    if (!first) {
      if (!(before->second == entry.totals)) Report(epoch, Text("value ", Hex(prefix), " has two different sums"));
      return;
    }
    Know(name);
    if (level < 0) {
      CheckBlock(name, entry, epoch);
    } else {
      CheckNode(level, name, entry, epoch);
    }
  }

  void CheckNode(int level, const ValueName& name, const TreeChild& entry, uint64_t epoch) {
    const auto node = values_.ReadNode(name);
    if (!node.ok()) return Report(epoch, FromAbsl(node.status().message()));
    ++found_.nodes;
    TreeChild sums = ChildOf(**node, entry.written);
    sums.slot = entry.slot;
    if (!(sums == entry)) Report(epoch, Text("tree node ", Hex(name.place), " is not what its parent says"));
    if (name.kind == ValueKind::kLeaf) {
      const auto derived = values_.ReadDerived(name);
      if (!derived.ok()) Report(epoch, FromAbsl(derived.status().message()));
    }
    const int bits = level == 0 ? kLeafBits : kDirectoryBits;
    for (const TreeChild& child : (*node)->children) Check(level - 1, name.place << bits | child.slot, child, epoch);
  }

  void CheckBlock(const ValueName& name, const TreeChild& entry, uint64_t epoch) {
    const auto block = values_.ReadBlock(name);
    if (!block.ok()) return Report(epoch, FromAbsl(block.status().message()));
    ++found_.blocks;
    found_.voxels += (*block)->voxels.size();
    const auto is_static = [](const Voxel& voxel) { return voxel.is_static; };
    const VoxelIndex at = BlockIndexOf((*block)->key);
    const auto where = [&at] { return Text("block (", at.x, ", ", at.y, ", ", at.z, ")"); };
    if ((*block)->voxels.size() != entry.totals.voxels ||
        static_cast<uint64_t>(std::ranges::count_if((*block)->voxels, is_static)) != entry.totals.static_voxels) {
      Report(epoch, Text(where(), " has not as many voxels as its leaf says"));
    }
    if (!block_) return;
    const absl::Status holds = block_(**block);
    if (!holds.ok()) Report(epoch, Text(where(), ": ", FromAbsl(holds.message())));
  }

  absl::Status FindLeftBehind() {
    for (const auto& [group, key] : stored_) {
      if (known_.contains({group, key})) continue;
      const absl::Status still = engine_.GetValue(group, key).status();
      if (absl::IsNotFound(still)) continue;
      if (!still.ok() && !absl::IsDataLoss(still)) return still;
      Report(std::nullopt, Text("value ", key, " of ", group, " is left behind: no epoch reaches it"));
    }
    return absl::OkStatus();
  }

  void Report(std::optional<uint64_t> epoch, std::string_view problem) {
    ++found_.problem_count;
    if (found_.problems.size() >= kMostProblems) return;
    found_.problems.push_back(epoch ? Text("epoch ", *epoch, ": ", problem) : std::string(problem));
  }

  const Engine& engine_;
  const uint64_t incarnation_;
  const std::string partition_;
  MapCaches caches_;
  const MapValues values_;
  const std::function<absl::Status(const Block&)>& block_;
  std::vector<StoredValue> stored_;
  std::set<StoredValue> known_;  ///< reached by an epoch, or named for collection
  std::map<ValueName, MapTotals> checked_;
  MapVerification found_;
};

}  // namespace

absl::StatusOr<MapVerification> MapStore::Verify(std::string_view map,
                                                 const std::function<absl::Status(const Block&)>& block,
                                                 const Progress& progress) const {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(state_->engine, map);
  if (!incarnation.ok()) return incarnation.status();
  const auto oldest = ReadRow(state_->engine, HeadPartition(*incarnation), kOldestRow, DecodeNumber);
  if (!oldest.ok()) return oldest.status();
  // Nothing of what can be read now is collected meanwhile.
  const auto pinned = Open(map, *oldest ? (*oldest)->value : 0);
  if (!pinned.ok()) return pinned.status();
  return Verifier(state_->engine, *incarnation, block).Run(progress);
}

}  // namespace mapkeep
