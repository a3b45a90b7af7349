#include "client/exporters/change_file.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <array>
#include <bit>
#include <limits>
#include <utility>

namespace mapkeep {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is written little-endian");

using Colour = std::array<unsigned char, 3>;
constexpr std::array<Colour, 3> kColours = {{{40, 190, 80}, {220, 60, 50}, {245, 150, 30}}};  ///< by ChangeClass
constexpr size_t kWidestCount = std::numeric_limits<uint64_t>::digits10 + 1;

}  // namespace

absl::StatusOr<ChangeFileWriter> ChangeFileWriter::Create(const std::filesystem::path& path, std::string comment) {
  if (path.extension() != ".ply") {
    return absl::InvalidArgumentError(absl::StrCat(path.string(), ": expected a name that ends in .ply"));
  }
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  ChangeFileWriter writer(*std::move(file), std::move(comment));
  writer.file_.stream() << writer.Header();
  return writer;
}

void ChangeFileWriter::Add(const Eigen::Vector3d& point, ChangeClass change) {
  const Eigen::Vector3f position = point.cast<float>();
  const Colour& colour = kColours[static_cast<size_t>(change)];
  file_.stream().write(reinterpret_cast<const char*>(position.data()), sizeof(float) * 3);
  file_.stream().write(reinterpret_cast<const char*>(colour.data()), colour.size());
  ++count_;
}

absl::Status ChangeFileWriter::Finish() {
  file_.stream().seekp(0) << Header();
  return file_.Finish();
}

std::string ChangeFileWriter::Header() const {
  const std::string count = absl::StrCat(count_);
  std::string header = absl::StrCat("ply\nformat binary_little_endian 1.0\ncomment made by mapkeep",
                                    std::string(kWidestCount - count.size(), ' '), "\ncomment ", comment_,
                                    "\nelement vertex ", count, "\n");
  for (const char axis : {'x', 'y', 'z'}) absl::StrAppendFormat(&header, "property float %c\n", axis);
  for (const char* channel : {"red", "green", "blue"}) absl::StrAppend(&header, "property uchar ", channel, "\n");
  return absl::StrCat(header, "end_header\n");
}

}  // namespace mapkeep
