#include "client/exporters/pose_file.h"

#include <array>
#include <charconv>
#include <string_view>

#include "client/exporters/output_file.h"

namespace mapkeep {

absl::Status WritePoses(const std::filesystem::path& path, std::span<const Pose> poses) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  for (const Pose& pose : poses) {
    std::string_view separator;
    for (const double value : RowsOf(pose)) {
      std::array<char, 32> digits;
      const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
      file->stream() << separator << std::string_view(digits.data(), end - digits.data());
      separator = " ";
    }
    file->stream() << '\n';
  }
  return file->Finish();
}

}  // namespace mapkeep
