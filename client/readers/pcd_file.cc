#include "client/readers/pcd_file.h"

#include <absl/strings/escaping.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>
#include <absl/strings/string_view.h>
#include <pcl/io/lzf.h>

#include <array>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "client/readers/pcd_header.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

using Encoding = PcdHeader::Encoding;

absl::Status AtFile(const fs::path& file, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(file.string(), ": ", what));
}

/// The fields that are read: x, y, z and, if there is one, intensity.
using Wanted = std::vector<const PcdHeader::Field*>;

void AddPoint(const std::array<float, 4>& numbers, const Wanted& wanted, Scan* scan) {
  scan->points.emplace_back(numbers[0], numbers[1], numbers[2]);
  if (wanted.size() > 3) scan->intensities.push_back(numbers[3]);
}

template <typename Number>
float Load(const char* bytes) {
  Number number;
  std::memcpy(&number, bytes, sizeof(number));
  return static_cast<float>(number);
}

/// One number of every point as float32, whatever its type in the file.
struct Column {
  const char* begin = nullptr;
  size_t stride = 0;  ///< bytes from a point to the next
  float (*load)(const char* bytes) = nullptr;

  float operator[](size_t point) const { return load(begin + point * stride); }
};

float (*LoaderOf(const PcdHeader::Field& field))(const char* bytes) {
  switch (field.type) {
    case 'F':
      return field.size == 4 ? Load<float> : Load<double>;
    case 'U':
      if (field.size == 1) return Load<uint8_t>;
      if (field.size == 2) return Load<uint16_t>;
      return field.size == 4 ? Load<uint32_t> : Load<uint64_t>;
    default:
      if (field.size == 1) return Load<int8_t>;
      if (field.size == 2) return Load<int16_t>;
      return field.size == 4 ? Load<int32_t> : Load<int64_t>;
  }
}

absl::StatusOr<std::string> ReadBytes(const fs::path& file, std::ifstream& stream, uint64_t bytes) {
  std::string content(bytes, '\0');
  if (!stream.read(content.data(), static_cast<std::streamsize>(bytes))) {
    return AtFile(file, "truncated: it became shorter while it was read");
  }
  return content;
}

/// The points as the binary encoding has them, or, of the compressed one, field by field.
absl::StatusOr<std::string> ReadBody(const fs::path& file, const PcdHeader& header, std::ifstream& stream) {
  const uint64_t needed = header.points * header.point_bytes;
  if (header.encoding == Encoding::kBinary) return ReadBytes(file, stream, needed);
  std::array<uint32_t, 2> sizes{};  // compressed, uncompressed: ReadPcdHeader has held them to the file
  stream.read(reinterpret_cast<char*>(sizes.data()), sizeof(sizes));
  absl::StatusOr<std::string> compressed = ReadBytes(file, stream, sizes[0]);
  if (!compressed.ok()) return compressed.status();
  std::string content(needed, '\0');
  if (pcl::lzfDecompress(compressed->data(), sizes[0], content.data(), sizes[1]) != needed) {
    return AtFile(file, "its points cannot be read: the compressed bytes are damaged");
  }
  return content;
}

absl::StatusOr<Scan> ReadBinary(const fs::path& file, const PcdHeader& header, const Wanted& wanted,
                                std::ifstream& stream) {
  absl::StatusOr<std::string> body = ReadBody(file, header, stream);
  if (!body.ok()) return body.status();
  const bool by_field = header.encoding == Encoding::kCompressed;
  std::array<Column, 4> columns;
  for (size_t i = 0; i < wanted.size(); ++i) {
    const PcdHeader::Field& field = *wanted[i];
    columns[i] = {.begin = body->data() + (by_field ? field.offset * header.points : field.offset),
                  .stride = by_field ? size_t{field.size} * field.count : header.point_bytes,
                  .load = LoaderOf(field)};
  }
  Scan scan;
  scan.points.reserve(header.points);
  for (size_t point = 0; point < header.points; ++point) {
    std::array<float, 4> numbers{};
    for (size_t i = 0; i < wanted.size(); ++i) numbers[i] = columns[i][point];
    AddPoint(numbers, wanted, &scan);
  }
  return scan;
}

absl::StatusOr<Scan> ReadAscii(const fs::path& file, const PcdHeader& header, const Wanted& wanted,
                               std::ifstream& stream) {
  size_t words_of_point = 0;
  std::array<size_t, 4> places{};  // of the wanted numbers among the words of a point
  for (const PcdHeader::Field& field : header.fields) {
    for (size_t i = 0; i < wanted.size(); ++i) {
      if (wanted[i] == &field) places[i] = words_of_point;
    }
    words_of_point += field.count;
  }
  Scan scan;  // grows with the lines that are there, not with what the header says
  for (std::string line; scan.points.size() < header.points && std::getline(stream, line);) {
    const std::vector<absl::string_view> words = absl::StrSplit(line, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    if (words.empty()) continue;
    if (words.size() != words_of_point) {
      return AtFile(file, absl::StrFormat("point %d has %d values where %d are expected", scan.points.size(),
                                          words.size(), words_of_point));
    }
    std::array<float, 4> numbers{};
    for (size_t i = 0; i < wanted.size(); ++i) {
      double number = 0;
      if (!absl::SimpleAtod(words[places[i]], &number)) {
        return AtFile(file, absl::StrFormat("point %d: %s '%s' is not a number", scan.points.size(), wanted[i]->name,
                                            absl::CHexEscape(words[places[i]].substr(0, 40))));
      }
      numbers[i] = static_cast<float>(number);
    }
    AddPoint(numbers, wanted, &scan);
  }
  if (scan.points.size() < header.points) {
    return AtFile(file,
                  absl::StrFormat("truncated: %d points where %d are announced", scan.points.size(), header.points));
  }
  return scan;
}

}  // namespace

absl::StatusOr<Scan> ReadPcdPoints(const fs::path& file) {
  absl::StatusOr<PcdHeader> header = ReadPcdHeader(file);
  if (!header.ok()) return header.status();
  Wanted wanted;
  for (const char* name : {"x", "y", "z"}) {
    wanted.push_back(FindField(*header, name));
    if (wanted.back() == nullptr) return AtFile(file, "has no fields x, y and z");
  }
  if (const PcdHeader::Field* intensity = FindField(*header, "intensity")) wanted.push_back(intensity);
  std::ifstream stream(file, std::ios::binary);
  if (!stream.seekg(static_cast<std::streamoff>(header->data_begin))) return AtFile(file, "cannot be read");
  return (header->encoding == Encoding::kAscii ? ReadAscii : ReadBinary)(file, *header, wanted, stream);
}

}  // namespace mapkeep
