#include "client/exporters/octomap_file.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <bit>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/exporters/output_file.h"
#include "client/exporters/spool_file.h"

namespace mapkeep {
namespace {

constexpr int kTreeDepth = 16;  // OctoMap's, fixed
constexpr int kSubVoxelBits = 2;

/// Bits of three coordinates in turns, x lowest: the order in which OctoMap walks its children.
uint64_t Interleave(uint32_t x, uint32_t y, uint32_t z) {
  uint64_t key = 0;
  for (int bit = 0; bit < 21; ++bit) {
    key |= static_cast<uint64_t>(x >> bit & 1) << (3 * bit) | static_cast<uint64_t>(y >> bit & 1) << (3 * bit + 1) |
           static_cast<uint64_t>(z >> bit & 1) << (3 * bit + 2);
  }
  return key;
}

/// What is said of a child, two bits.
enum Child : uint32_t { kUnknown = 0, kOccupiedLeaf = 2, kInner = 3 };

std::string NodeBytes(uint32_t children) {
  return {static_cast<char>(children & 0xff), static_cast<char>(children >> 8)};
}

/// The children of a node, for the run of sorted keys below it: calls child(number, run) for each that has any.
template <typename Keys, typename KeyOf, typename Visit>
void ForEachChild(const Keys& keys, int level, const KeyOf& key_of, const Visit& child) {
  for (auto begin = keys.begin(); begin != keys.end();) {
    const uint64_t prefix = key_of(*begin) >> (3 * level);
    auto end = begin;
    while (end != keys.end() && key_of(*end) >> (3 * level) == prefix) ++end;
    child(static_cast<int>(prefix & 7), Keys(begin, end));
    begin = end;
  }
}

/// Encodes the subtree of sorted leaf keys in preorder; `level` is how many levels of leaves lie below a child. Gives
/// its nodes, leaves too.
uint64_t Encode(std::span<const uint64_t> leaves, int level, std::string* out) {
  const auto key_of = [](uint64_t key) { return key; };
  uint32_t children = 0;
  ForEachChild(leaves, level, key_of, [&](int number, std::span<const uint64_t>) {
    children |= (level == 0 ? kOccupiedLeaf : kInner) << (2 * number);
  });
  out->append(NodeBytes(children));
  uint64_t nodes = 1;
  ForEachChild(leaves, level, key_of,
               [&](int, std::span<const uint64_t> run) { nodes += level == 0 ? 1 : Encode(run, level - 1, out); });
  return nodes;
}

/// Where an encoded block lies.
struct Piece {
  uint64_t key = 0;  ///< of the block in the tree
  uint64_t offset = 0;
  uint32_t bytes = 0;
};

class OctoMapFile final : public MapExporter {
 public:
  OctoMapFile(OutputFile file, SpoolFile spool, const ExportedMap& map, const ExportOptions& options)
      : file_(std::move(file)),
        spool_(std::move(spool)),
        map_(map),
        options_(options),
        sub_bits_(options.detail == PointDetail::kSubVoxels ? kSubVoxelBits : 0) {}

  absl::Status Add(const Block& block) override {
    const std::vector<uint64_t> leaves = LeavesOf(block);
    if (leaves.empty()) return absl::OkStatus();
    const VoxelIndex at = BlockIndexOf(block.key);
    const int32_t half = 1 << (BlockDepth() - 1);
    for (const int32_t c : {at.x, at.y, at.z}) {
      if (c < -half || c >= half) {
        return absl::OutOfRangeError(absl::StrFormat(
            "block (%d, %d, %d) lies beyond the 32,768 leaves of %g m that OctoMap reaches from the origin: cut with "
            "--box%s",
            at.x, at.y, at.z, Resolution(), sub_bits_ > 0 ? ", or take leaves of a voxel with --centroids" : ""));
      }
    }
    std::string bytes;
    nodes_ += Encode(leaves, kBlockBits + sub_bits_ - 1, &bytes);
    count_ += leaves.size();
    pieces_.push_back(
        {Interleave(at.x + half, at.y + half, at.z + half), spool_.size(), static_cast<uint32_t>(bytes.size())});
    return spool_.Append(bytes);
  }

  absl::Status Finish() override {
    std::ranges::sort(pieces_, {}, &Piece::key);
    const std::span<const Piece> pieces(pieces_);
    const uint64_t above = pieces.empty() ? 0 : CountAbove(pieces, BlockDepth() - 1);
    file_.stream()
        << "# Octomap OcTree binary file\n# (feel free to add / change comments, but leave the first line as "
           "it is!)\n#\nid OcTree\nsize "
        << above + nodes_ << "\nres " << absl::StrFormat("%g", Resolution()) << "\ndata\n";
    if (!pieces.empty()) {
      if (absl::Status status = WriteAbove(pieces, BlockDepth() - 1); !status.ok()) return status;
    }
    return file_.Finish();
  }

 private:
  using Pieces = std::span<const Piece>;

  double Resolution() const { return map_.voxel_size / (1 << sub_bits_); }
  /// Levels of the tree above the blocks.
  int BlockDepth() const { return kTreeDepth - kBlockBits - sub_bits_; }

  std::vector<uint64_t> LeavesOf(const Block& block) const {
    std::vector<uint64_t> leaves;
    constexpr uint32_t kMask = kBlockSize - 1;
    const auto inside = [&](const Eigen::Vector3d& point) {
      return !options_.box.has_value() || ((point.array() >= options_.box->min().array()).all() &&
                                           (point.array() < options_.box->max().array()).all());
    };
    for (const Voxel& voxel : block.voxels) {
      const uint32_t x = voxel.position & kMask, y = voxel.position >> kBlockBits & kMask,
                     z = voxel.position >> (2 * kBlockBits);
      if (sub_bits_ == 0) {
        if (inside(MeanOf(block, voxel, map_.voxel_size))) leaves.push_back(Interleave(x, y, z));
        continue;
      }
      const Eigen::Vector3d corner = CornerOf(VoxelIndexOf(VoxelKeyOf(block.key, voxel.position)), map_.voxel_size);
      for (uint64_t rest = voxel.mask; rest != 0; rest &= rest - 1) {
        const uint32_t bit = std::countr_zero(rest), i = bit & 3, j = bit >> 2 & 3, k = bit >> 4;
        if (!inside(corner + Eigen::Vector3d(i + 0.5, j + 0.5, k + 0.5) * Resolution())) continue;
        leaves.push_back(Interleave(4 * x + i, 4 * y + j, 4 * z + k));
      }
    }
    std::ranges::sort(leaves);
    return leaves;
  }

  /// Nodes above the blocks.
  static uint64_t CountAbove(Pieces pieces, int level) {
    uint64_t nodes = 1;
    if (level == 0) return nodes;
    ForEachChild(
        pieces, level, [](const Piece& piece) { return piece.key; },
        [&](int, Pieces run) { nodes += CountAbove(run, level - 1); });
    return nodes;
  }

  absl::Status WriteAbove(Pieces pieces, int level) {
    const auto key_of = [](const Piece& piece) { return piece.key; };
    uint32_t children = 0;
    ForEachChild(pieces, level, key_of, [&](int number, Pieces) { children |= kInner << (2 * number); });
    file_.stream() << NodeBytes(children);
    absl::Status status;
    ForEachChild(pieces, level, key_of, [&](int, Pieces run) {
      if (status.ok()) status = level == 0 ? CopyBlock(run.front()) : WriteAbove(run, level - 1);
    });
    return status;
  }

  absl::Status CopyBlock(const Piece& piece) {
    std::string bytes(piece.bytes, '\0');
    if (absl::Status status = spool_.Read(piece.offset, bytes.data(), bytes.size()); !status.ok()) return status;
    file_.stream() << bytes;
    return absl::OkStatus();
  }

  OutputFile file_;
  SpoolFile spool_;
  const ExportedMap map_;
  const ExportOptions options_;
  const int sub_bits_;
  std::vector<Piece> pieces_;
  uint64_t nodes_ = 0;  ///< in the blocks
};

}  // namespace

absl::StatusOr<std::unique_ptr<MapExporter>> OpenOctoMapFile(const std::filesystem::path& path, const ExportedMap& map,
                                                             const ExportOptions& options) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  absl::StatusOr<SpoolFile> spool = SpoolFile::Create(path);
  if (!spool.ok()) return spool.status();
  return std::make_unique<OctoMapFile>(*std::move(file), *std::move(spool), map, options);
}

}  // namespace mapkeep
