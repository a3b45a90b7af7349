#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/geometry/pose.h"

namespace mapkeep {

/// The header of a PCD file, version 0.7 (or older, without VIEWPOINT). PCL's own reader trusts it with its memory, and
/// reads past the end of some damaged ones, so it is judged here.
struct PcdHeader {
  enum class Encoding : uint8_t { kAscii, kBinary, kCompressed };
  struct Field {
    std::string name;
    char type = 'F';      ///< F, I or U
    uint32_t size = 4;    ///< bytes of one number
    uint32_t count = 1;   ///< numbers
    uint32_t offset = 0;  ///< bytes from the start of the point
  };
  std::vector<Field> fields;
  uint32_t point_bytes = 0;
  uint64_t points = 0;
  Pose viewpoint = Pose::Identity();
  Encoding encoding = Encoding::kAscii;
  uint64_t data_begin = 0;  ///< bytes from the start of the file
};

/// The field of this name, or nullptr.
const PcdHeader::Field* FindField(const PcdHeader& header, std::string_view name);

/// INVALID_ARGUMENT naming the file and what is wrong: no PCD file, sizes that contradict each other, more points than
/// a scan may hold, fewer bytes than the points need, a VIEWPOINT that is no pose. NOT_FOUND without the file.
absl::StatusOr<PcdHeader> ReadPcdHeader(const std::filesystem::path& file);

}  // namespace mapkeep
