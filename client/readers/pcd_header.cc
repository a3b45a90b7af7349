#include "client/readers/pcd_header.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/escaping.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>
#include <absl/strings/string_view.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <utility>

#include "client/readers/session_directory.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr size_t kLongestHeader = 16384;  // bytes
constexpr uint32_t kMostNumbers = 1024;   // of a field
constexpr uint64_t kMostExpansion = 88;   // of LZF: three bytes repeat at most 264

using Words = std::vector<absl::string_view>;
using Lines = absl::flat_hash_map<absl::string_view, Words>;  // by the first word, which is left out

absl::Status AtFile(const fs::path& file, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(file.string(), ": ", what));
}

/// The lines before DATA and that one, by their first word; `length` becomes their bytes.
absl::StatusOr<Lines> SplitHeader(const fs::path& file, absl::string_view text, uint64_t* length) {
  Lines lines;
  size_t begin = 0;
  for (size_t end = text.find('\n'); end != absl::string_view::npos; end = text.find('\n', begin)) {
    const absl::string_view line = text.substr(begin, end - begin);
    begin = end + 1;
    Words words = absl::StrSplit(line, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    if (words.empty() || words.front()[0] == '#') continue;
    const absl::string_view key = words.front();
    constexpr std::array kKeys = {"VERSION", "FIELDS", "SIZE",      "TYPE",   "COUNT",
                                  "WIDTH",   "HEIGHT", "VIEWPOINT", "POINTS", "DATA"};
    if (std::ranges::find(kKeys, key) == kKeys.end()) {
      return AtFile(file, absl::StrFormat("not a readable PCD file: its header has a line '%s'",
                                          absl::CHexEscape(key.substr(0, 40))));
    }
    words.erase(words.begin());
    lines[key] = std::move(words);
    if (key == "DATA") {
      *length = begin;
      return lines;
    }
  }
  return AtFile(file, "not a readable PCD file: its header does not end with a DATA line");
}

absl::StatusOr<Words> Row(const fs::path& file, const Lines& lines, absl::string_view key, size_t count) {
  const auto row = lines.find(key);
  if (row == lines.end()) return AtFile(file, absl::StrCat("not a readable PCD file: it has no line ", key));
  if (row->second.size() != count) {
    return AtFile(file, absl::StrFormat("%s has %d values where %d are expected", key, row->second.size(), count));
  }
  return row->second;
}

/// The whole numbers of a line.
absl::StatusOr<std::vector<uint64_t>> Counts(const fs::path& file, const Lines& lines, absl::string_view key,
                                             size_t count) {
  absl::StatusOr<Words> words = Row(file, lines, key, count);
  if (!words.ok()) return words.status();
  std::vector<uint64_t> numbers(count);
  for (size_t i = 0; i < count; ++i) {
    if (!absl::SimpleAtoi((*words)[i], &numbers[i])) {
      return AtFile(file, absl::StrFormat("%s: '%s' is not a count", key, (*words)[i].substr(0, 40)));
    }
  }
  return numbers;
}

absl::Status ReadFields(const fs::path& file, const Lines& lines, PcdHeader* header) {
  const auto names = lines.find("FIELDS");
  if (names == lines.end()) return AtFile(file, "not a readable PCD file: it has no line FIELDS");
  const size_t count = names->second.size();
  absl::StatusOr<std::vector<uint64_t>> sizes = Counts(file, lines, "SIZE", count);
  if (!sizes.ok()) return sizes.status();
  absl::StatusOr<Words> types = Row(file, lines, "TYPE", count);
  if (!types.ok()) return types.status();
  std::vector<uint64_t> counts(count, 1);
  if (lines.contains("COUNT")) {
    absl::StatusOr<std::vector<uint64_t>> given = Counts(file, lines, "COUNT", count);
    if (!given.ok()) return given.status();
    counts = *std::move(given);
  }
  for (size_t i = 0; i < count; ++i) {
    const uint64_t size = (*sizes)[i];
    const absl::string_view type = (*types)[i];
    const bool known_size = size == 1 || size == 2 || size == 4 || size == 8;
    const bool known_type = type == "F" ? size >= 4 : (type == "I" || type == "U");
    if (!known_size || !known_type || counts[i] < 1 || counts[i] > kMostNumbers) {
      return AtFile(file, absl::StrFormat("field '%s' of type %s, size %d and count %d is not known", names->second[i],
                                          type, size, counts[i]));
    }
    header->fields.push_back({.name = std::string(names->second[i]),
                              .type = type[0],
                              .size = static_cast<uint32_t>(size),
                              .count = static_cast<uint32_t>(counts[i]),
                              .offset = header->point_bytes});
    header->point_bytes += static_cast<uint32_t>(size * counts[i]);
  }
  return absl::OkStatus();
}

absl::Status ReadPointCount(const fs::path& file, const Lines& lines, PcdHeader* header) {
  std::array<uint64_t, 3> numbers{};
  const std::array<absl::string_view, 3> keys = {"WIDTH", "HEIGHT", "POINTS"};
  for (size_t i = 0; i < keys.size(); ++i) {
    absl::StatusOr<std::vector<uint64_t>> number = Counts(file, lines, keys[i], 1);
    if (!number.ok()) return number.status();
    numbers[i] = number->front();
  }
  const auto [width, height, points] = numbers;
  if (points > kMostPoints) {
    return AtFile(file, absl::StrFormat("%d points, more than the %d a scan may hold", points, kMostPoints));
  }
  // Both factors are at most the product, unless it is 0.
  if (width > kMostPoints || height > kMostPoints || width * height != points) {
    return AtFile(file, absl::StrFormat("WIDTH %d times HEIGHT %d is not POINTS %d", width, height, points));
  }
  header->points = points;
  return absl::OkStatus();
}

absl::Status ReadViewpoint(const fs::path& file, const Lines& lines, PcdHeader* header) {
  if (!lines.contains("VIEWPOINT")) return absl::OkStatus();
  absl::StatusOr<Words> words = Row(file, lines, "VIEWPOINT", 7);
  if (!words.ok()) return words.status();
  std::array<double, 7> numbers{};
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (!absl::SimpleAtod((*words)[i], &numbers[i]) || !std::isfinite(numbers[i])) {
      return AtFile(file, absl::StrFormat("VIEWPOINT: '%s' is not a finite number", (*words)[i].substr(0, 40)));
    }
  }
  const auto [x, y, z, qw, qx, qy, qz] = numbers;
  const Eigen::Quaterniond rotation(qw, qx, qy, qz);
  if (std::abs(rotation.norm() - 1) > 1e-3) {
    return AtFile(file,
                  absl::StrFormat("VIEWPOINT is not a rotation: its quaternion has length %.3g", rotation.norm()));
  }
  header->viewpoint.linear() = rotation.normalized().toRotationMatrix();
  header->viewpoint.translation() = Eigen::Vector3d(x, y, z);
  return absl::OkStatus();
}

absl::Status ReadEncoding(const fs::path& file, const Lines& lines, PcdHeader* header) {
  absl::StatusOr<Words> words = Row(file, lines, "DATA", 1);
  if (!words.ok()) return words.status();
  const absl::string_view encoding = words->front();
  if (encoding == "ascii") {
    header->encoding = PcdHeader::Encoding::kAscii;
  } else if (encoding == "binary") {
    header->encoding = PcdHeader::Encoding::kBinary;
  } else if (encoding == "binary_compressed") {
    header->encoding = PcdHeader::Encoding::kCompressed;
  } else {
    return AtFile(file, absl::StrFormat("DATA '%s' is not known", encoding.substr(0, 40)));
  }
  return absl::OkStatus();
}

/// Whether the file holds the bytes that its points need. The compressed encoding begins with two sizes of its own.
absl::Status CheckLength(const fs::path& file, std::ifstream& stream, uint64_t bytes, const PcdHeader& header) {
  const uint64_t needed = header.points * header.point_bytes;
  const uint64_t held = bytes - header.data_begin;
  if (header.encoding == PcdHeader::Encoding::kBinary && held < needed) {
    return AtFile(file, absl::StrFormat("truncated: %d bytes of points where %d are announced", held, needed));
  }
  if (header.encoding != PcdHeader::Encoding::kCompressed) return absl::OkStatus();
  std::array<uint32_t, 2> sizes{};  // compressed, uncompressed
  stream.clear();
  stream.seekg(static_cast<std::streamoff>(header.data_begin));
  if (!stream.read(reinterpret_cast<char*>(sizes.data()), sizeof(sizes)) || held < sizeof(sizes) + sizes[0]) {
    return AtFile(file, "truncated: fewer bytes than its compressed points take");
  }
  if (sizes[1] != needed) {
    return AtFile(file, absl::StrFormat("its compressed points are %d bytes where %d are announced", sizes[1], needed));
  }
  if (needed > sizes[0] * kMostExpansion) {
    return AtFile(file, absl::StrFormat("%d compressed bytes cannot hold %d bytes of points", sizes[0], needed));
  }
  return absl::OkStatus();
}

}  // namespace

const PcdHeader::Field* FindField(const PcdHeader& header, std::string_view name) {
  for (const PcdHeader::Field& field : header.fields) {
    if (field.name == name) return &field;
  }
  return nullptr;
}

absl::StatusOr<PcdHeader> ReadPcdHeader(const fs::path& file) {
  std::error_code error;
  const uintmax_t bytes = fs::file_size(file, error);
  if (error) return absl::NotFoundError(absl::StrCat(file.string(), ": ", error.message()));
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return AtFile(file, absl::StrCat("cannot be read: ", std::strerror(errno)));
  std::string text(kLongestHeader, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(stream.gcount()));

  PcdHeader header;
  absl::StatusOr<Lines> lines = SplitHeader(file, text, &header.data_begin);
  if (!lines.ok()) return lines.status();
  for (const auto read : {ReadFields, ReadPointCount, ReadViewpoint, ReadEncoding}) {
    const absl::Status status = read(file, *lines, &header);
    if (!status.ok()) return status;
  }
  const absl::Status long_enough = CheckLength(file, stream, bytes, header);
  if (!long_enough.ok()) return long_enough;
  return header;
}

}  // namespace mapkeep
