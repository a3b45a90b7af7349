// Rows and tree nodes of a store, which may come out of a backup from elsewhere. Input: a byte for the kind, then the
// message, which gets the checksum that it needs; a kind of 255: the whole record.

#include <cstdint>
#include <string>

#include "core/checksum/crc32c.h"
#include "storage/byte_planes.h"
#include "storage/map_rows.h"
#include "storage/session_codec.h"
#include "storage/tree_node.h"

namespace {

template <typename Result>
void Drop(const Result&) {}

void Decode(uint8_t kind, std::string_view record) {
  switch (kind % 18) {
    case 0:
      return Drop(mapkeep::DecodeMap(record));
    case 1:
      return Drop(mapkeep::DecodeEpoch(record));
    case 2:
      return Drop(mapkeep::DecodeIntent(record));
    case 3:
      return Drop(mapkeep::DecodeApplied(record));
    case 4:
      return Drop(mapkeep::DecodeStaged(record));
    case 5:
      return Drop(mapkeep::DecodePurge(record));
    case 6:
      return Drop(mapkeep::DecodePin(record));
    case 7:
      return Drop(mapkeep::DecodeLease(record));
    case 8:
      return Drop(mapkeep::DecodeCommit(record));
    case 9:
      return Drop(mapkeep::DecodeSuperseded(record));
    case 10:
      return Drop(mapkeep::DecodeTags(record));
    case 11:
      return Drop(mapkeep::DecodeWithdrawn(record));
    case 12:
      return Drop(mapkeep::DecodeSession(record));
    case 13:
      return Drop(mapkeep::DecodeContent(record));
    case 14:
      return Drop(mapkeep::DecodeCleanup(record));
    case 15:
      return Drop(mapkeep::DecodePoses(record));
    default:
      const auto level = static_cast<mapkeep::ValueKind>(kind % 18 == 16 ? 0 : 1);
      return Drop(mapkeep::DecodeNode(record, {level, 0, {}}));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  std::string record;
  if (data[0] != 255) {
    record = "R\x01";
    mapkeep::AppendNumber<4>(record, mapkeep::Crc32c(bytes));
  }
  record.append(bytes);
  Decode(data[0], record);
  return 0;
}
