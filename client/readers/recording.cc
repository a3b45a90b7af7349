#include "client/readers/recording.h"

#include <fstream>

namespace mapkeep {
namespace {

bool BeginsWith(const std::filesystem::path& file, std::string_view magic) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return false;
  std::ifstream stream(file, std::ios::binary);
  std::string begin(magic.size(), '\0');
  return static_cast<bool>(stream.read(begin.data(), static_cast<std::streamsize>(begin.size()))) && begin == magic;
}

}  // namespace

bool IsRosBag(const std::filesystem::path& file) { return BeginsWith(file, "#ROSBAG V"); }

bool IsMcap(const std::filesystem::path& file) { return BeginsWith(file, "\x89MCAP"); }

}  // namespace mapkeep
