#include "tests/unit/client/session_files.h"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

namespace mapkeep {

namespace fs = std::filesystem;

TemporaryDirectory::TemporaryDirectory() {
  std::string name = (fs::temp_directory_path() / "mapkeep-test-XXXXXX").string();
  path_ = mkdtemp(name.data());
}

TemporaryDirectory::~TemporaryDirectory() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void WriteText(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << text;
}

void WriteBin(const fs::path& file, const std::vector<PointRow>& points) {
  WriteText(file, std::string(reinterpret_cast<const char*>(points.data()), points.size() * sizeof(PointRow)));
}

void WriteKittiSession(const fs::path& directory, size_t count) {
  std::string poses;
  for (size_t i = 0; i < count; ++i) {
    char name[32];
    std::snprintf(name, sizeof(name), "%06zu.bin", i);
    WriteBin(directory / "velodyne" / name, {{5, 0, 1, 0.5F}, {0, 5, 1, 0.25F}, {3, 4, -1, 1}});
    poses += "1 0 0 " + std::to_string(i) + " 0 1 0 0 0 0 1 0\n";
  }
  WriteText(directory / "poses.txt", poses);
}

}  // namespace mapkeep
