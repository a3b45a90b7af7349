#include "tests/bench/scan_cache.h"

#include <tbb/parallel_for.h>

#include <fstream>
#include <optional>
#include <system_error>

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

// The file: the description and a line end; for every scan a count (uint64), the points (float32 x y z), the labels
// (uint32). A bench's own: nothing is guarded against but another description and a file that ends early.
template <typename T>
void Write(std::ofstream& file, const std::vector<T>& values) {
  file.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(T)));
}

template <typename T>
void Read(std::ifstream& file, size_t count, std::vector<T>& values) {
  values.resize(count);
  file.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(count * sizeof(T)));
}

std::optional<std::vector<LabelledScan>> ReadScans(const fs::path& path, const std::string& description, size_t count) {
  std::ifstream file(path, std::ios::binary);
  std::string line;
  if (!std::getline(file, line) || line != description) return std::nullopt;
  std::vector<LabelledScan> scans(count);
  for (LabelledScan& labelled : scans) {
    uint64_t points = 0;
    file.read(reinterpret_cast<char*>(&points), sizeof points);
    if (!file) return std::nullopt;
    Read(file, points, labelled.scan.points);
    Read(file, points, labelled.labels);
  }
  if (!file) return std::nullopt;
  return scans;
}

absl::Status WriteScans(const fs::path& path, const std::string& description, const std::vector<LabelledScan>& scans) {
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  std::ofstream file(path, std::ios::binary);
  file << description << '\n';
  for (const LabelledScan& labelled : scans) {
    const uint64_t points = labelled.labels.size();
    file.write(reinterpret_cast<const char*>(&points), sizeof points);
    Write(file, labelled.scan.points);
    Write(file, labelled.labels);
  }
  file.close();
  return file ? absl::OkStatus() : absl::UnknownError(path.string() + ": cannot be written");
}

}  // namespace

absl::StatusOr<std::vector<LabelledScan>> CachedScans(
    const fs::path& file, const std::string& description, size_t count,
    const std::function<absl::StatusOr<LabelledScan>(size_t index)>& make) {
  if (!file.empty()) {
    if (std::optional<std::vector<LabelledScan>> kept = ReadScans(file, description, count)) return *std::move(kept);
  }
  std::vector<LabelledScan> scans(count);
  std::vector<absl::Status> made(count);
  tbb::parallel_for(size_t{0}, count, [&](size_t i) {
    absl::StatusOr<LabelledScan> scan = make(i);
    made[i] = scan.status();
    if (!scan.ok()) return;
    scans[i] = *std::move(scan);
    scans[i].scan.intensities = {};
    scans[i].scan.time = 0;
  });
  for (const absl::Status& status : made) {
    if (!status.ok()) return status;
  }
  if (!file.empty()) {
    if (absl::Status written = WriteScans(file, description, scans); !written.ok()) return written;
  }
  return scans;
}

}  // namespace mapkeep
