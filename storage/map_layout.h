#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/voxels/voxel_index.h"
#include "storage/text.h"
#include "storage/write_id.h"

namespace mapkeep {

// Where a map's rows and values lie in the engine. Numbers in names are hexadecimal and of fixed width, so that rows
// sort by them.
//
//   partition "maps"              the catalogue
//     map/<name>                  MapRow: which incarnation has the name
//     purge/<incarnation>         PurgeRow: deleted, or never finished being made
//   partition "map/<incarnation>" the head partition of a map
//     map                         MapRow: there while the map lives; whatever must not outlive the map requires it
//     head                        EpochRow, the newest: what a commit compares
//     root/<epoch>                EpochRow of every epoch that can be read
//     oldest                      the oldest epoch that may be opened (absent: 0)
//     commit/<epoch>              CommitRow; old ones are sealed, see sealed_history.h
//     applied/<session>           AppliedRow: this session is in the map
//     withdrawn/<session>/<attempt> WithdrawnRow: this commit of it was rolled back
//     unsettled/<session>         random bits: a rollback took the session out or in, and its record may not say so yet
//     tags                        TagsRow: names of epochs, which keep what these reach
//     superseded/<epoch>          ValueNames that no epoch from this one on reaches
//     intent/<attempt>            IntentRow: an attempt under way
//     staged/<attempt>/<round>    StagedRow: the values that it writes
//     fence                       the newest fence given to any lease of the map
//     lease/<session>             LeaseRow
//     fence/<session>             the fence of that lease alone: what a commit compares
//     pin/<reader>                PinRow: the lowest epoch that a daemon reads
//   values "map/<incarnation>/tile/<tile>"  blocks and leaf of a tile, what was derived from them
//   values "map/<incarnation>/tree"         directories
//     <kind><place><attempt><round>         see ValueName

/// What a value is: a block, a node of the tree at a level (0: a leaf), or what was derived from a leaf's tile.
enum class ValueKind : uint8_t { kLeaf = 0, kDerived = 0xfe, kBlock = 0xff };

/// The name of one immutable value of a map.
struct ValueName {
  ValueKind kind{};
  uint64_t place = 0;  ///< BlockKey of a block, prefix of a node
  WriteId written;
  auto operator<=>(const ValueName&) const = default;

  template <typename H>
  friend H AbslHashValue(H h, const ValueName& name) {
    return H::combine(std::move(h), name.kind, name.place, name.written.attempt, name.written.round);
  }
};

/// The name of what is derived from the tile of a leaf. No tree names it: it goes with its leaf (DeleteNamed).
inline ValueName DerivedFrom(const ValueName& leaf) { return {ValueKind::kDerived, leaf.place, leaf.written}; }

inline std::string Hex(uint64_t number) { return Text(absl::Hex(number, absl::kZeroPad16)); }

inline constexpr std::string_view kCatalogue = "maps";
inline std::string CatalogueRow(std::string_view name) { return Text("map/", name); }
inline std::string PurgeRowKey(uint64_t incarnation) { return Text("purge/", Hex(incarnation)); }

inline std::string HeadPartition(uint64_t incarnation) { return Text("map/", Hex(incarnation)); }
inline constexpr std::string_view kMapRow = "map";
inline constexpr std::string_view kHeadRow = "head";
inline constexpr std::string_view kOldestRow = "oldest";
inline constexpr std::string_view kFenceRow = "fence";
inline std::string RootRow(uint64_t epoch) { return Text("root/", Hex(epoch)); }
inline std::string CommitRowKey(uint64_t epoch) { return Text("commit/", Hex(epoch)); }
inline std::string SupersededRow(uint64_t epoch) { return Text("superseded/", Hex(epoch)); }
inline std::string AppliedRowKey(std::string_view session) { return Text("applied/", session); }
inline constexpr std::string_view kTagsRow = "tags";
inline constexpr std::string_view kUnsettledPrefix = "unsettled/";
inline std::string UnsettledRow(std::string_view session) { return Text(kUnsettledPrefix, session); }
inline std::string WithdrawnRowKey(std::string_view session, uint64_t attempt) {
  return Text("withdrawn/", session, "/", Hex(attempt));
}
inline std::string IntentRowKey(uint64_t attempt) { return Text("intent/", Hex(attempt)); }
inline std::string StagedRowKey(const WriteId& id) {
  return Text("staged/", Hex(id.attempt), "/", absl::Hex(id.round, absl::kZeroPad8));
}
inline std::string LeaseRowKey(std::string_view session) { return Text("lease/", session); }
inline std::string SessionFenceRow(std::string_view session) { return Text("fence/", session); }
inline std::string PinRowKey(uint64_t reader) { return Text("pin/", Hex(reader)); }

/// The end of the range of keys that begin with `prefix`, which ends in '/'.
inline std::string EndOf(std::string_view prefix) {
  std::string end(prefix);
  end.back() = static_cast<char>(end.back() + 1);
  return end;
}

inline std::string TreeGroup(uint64_t incarnation) { return Text("map/", Hex(incarnation), "/tree"); }
inline std::string TileGroup(uint64_t incarnation, TileKey tile) {
  return Text("map/", Hex(incarnation), "/tile/", absl::Hex(static_cast<uint32_t>(tile), absl::kZeroPad8));
}

/// The group that holds a value: all of a tile lies together.
inline std::string GroupOf(uint64_t incarnation, const ValueName& name) {
  if (name.kind == ValueKind::kBlock) return TileGroup(incarnation, TileKeyOf(BlockKey{name.place}));
  if (name.kind == ValueKind::kLeaf || name.kind == ValueKind::kDerived)
    return TileGroup(incarnation, TileKey{static_cast<uint32_t>(name.place)});
  return TreeGroup(incarnation);
}

/// The value's key in its group.
inline std::string KeyOf(const ValueName& name) {
  const auto kind = static_cast<uint32_t>(name.kind);
  return Text(absl::Hex(kind, absl::kZeroPad2), Hex(name.place), Hex(name.written.attempt),
              absl::Hex(name.written.round, absl::kZeroPad8));
}

}  // namespace mapkeep
