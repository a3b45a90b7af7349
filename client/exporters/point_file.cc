#include "client/exporters/point_file.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>

namespace mapkeep {
namespace {

static_assert(std::endian::native == std::endian::little, "both formats are written little-endian");

constexpr size_t kWidestCount = std::numeric_limits<uint64_t>::digits10 + 1;

/// Spaces that make up for the digits that `count` does not have, `times` times.
std::string Padding(uint64_t count, size_t times) {
  return std::string(times * (kWidestCount - absl::StrCat(count).size()), ' ');
}

std::string PcdHeader(uint64_t count, CoordinateType coordinates, const std::vector<std::string>& comments) {
  std::string header = absl::StrCat("# .PCD v0.7 - Point Cloud Data file format", Padding(count, 2), "\n");
  for (const std::string& comment : comments) absl::StrAppend(&header, "# ", comment, "\n");
  const int size = coordinates == CoordinateType::kFloat32 ? 4 : 8;
  absl::StrAppendFormat(&header,
                        "VERSION 0.7\nFIELDS x y z intensity\nSIZE %d %d %d 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
                        "WIDTH %d\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS %d\nDATA binary\n",
                        size, size, size, count, count);
  return header;
}

std::string PlyHeader(uint64_t count, CoordinateType coordinates, const std::vector<std::string>& comments) {
  const std::string_view type = coordinates == CoordinateType::kFloat32 ? "float" : "double";
  std::string header =
      absl::StrCat("ply\nformat binary_little_endian 1.0\ncomment made by mapkeep", Padding(count, 1), "\n");
  for (const std::string& comment : comments) absl::StrAppend(&header, "comment ", comment, "\n");
  absl::StrAppend(&header, "element vertex ", count, "\n");
  for (const char axis : {'x', 'y', 'z'}) absl::StrAppendFormat(&header, "property %s %c\n", type, axis);
  absl::StrAppend(&header, "property float intensity\nend_header\n");
  return header;
}

template <typename Number>
void WriteRow(std::ostream& stream, const Eigen::Vector3d& point, float intensity) {
  std::array<char, 3 * sizeof(Number) + sizeof(float)> row;
  const Eigen::Matrix<Number, 3, 1> position = point.cast<Number>();
  std::memcpy(row.data(), position.data(), 3 * sizeof(Number));
  std::memcpy(row.data() + 3 * sizeof(Number), &intensity, sizeof(float));
  stream.write(row.data(), row.size());
}

}  // namespace

absl::StatusOr<PointFileFormat> PointFileFormatOf(const std::filesystem::path& path) {
  if (path.extension() == ".pcd") return PointFileFormat::kPcd;
  if (path.extension() == ".ply") return PointFileFormat::kPly;
  return absl::InvalidArgumentError(absl::StrCat(path.string(), ": expected a name that ends in .pcd or .ply"));
}

absl::StatusOr<PointFileWriter> PointFileWriter::Create(const std::filesystem::path& path, CoordinateType coordinates,
                                                        std::vector<std::string> comments) {
  absl::StatusOr<PointFileFormat> format = PointFileFormatOf(path);
  if (!format.ok()) return format.status();
  return Create(path, *format, coordinates, std::move(comments));
}

absl::StatusOr<PointFileWriter> PointFileWriter::Create(const std::filesystem::path& path, PointFileFormat format,
                                                        CoordinateType coordinates, std::vector<std::string> comments) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  PointFileWriter writer(*std::move(file), format, coordinates, std::move(comments));
  writer.file_.stream() << writer.Header(0);
  return writer;
}

PointFileWriter::PointFileWriter(OutputFile file, PointFileFormat format, CoordinateType coordinates,
                                 std::vector<std::string> comments)
    : file_(std::move(file)), format_(format), coordinates_(coordinates), comments_(std::move(comments)) {}

void PointFileWriter::Add(const Eigen::Vector3d& point, float intensity) {
  if (coordinates_ == CoordinateType::kFloat32) {
    WriteRow<float>(file_.stream(), point, intensity);
  } else {
    WriteRow<double>(file_.stream(), point, intensity);
  }
  ++count_;
}

absl::Status PointFileWriter::Finish() {
  file_.stream().seekp(0) << Header(count_);
  return file_.Finish();
}

std::string PointFileWriter::Header(uint64_t count) const {
  return format_ == PointFileFormat::kPcd ? PcdHeader(count, coordinates_, comments_)
                                          : PlyHeader(count, coordinates_, comments_);
}

}  // namespace mapkeep
