#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

/// A folder in memory for what is read from files, one a process.
inline const std::filesystem::path& ScratchFolder() {
  static const std::filesystem::path folder = [] {
    std::filesystem::path made = "/dev/shm/mapkeep-fuzz-" + std::to_string(getpid());
    std::filesystem::create_directories(made / "velodyne");
    std::atexit([] { std::filesystem::remove_all("/dev/shm/mapkeep-fuzz-" + std::to_string(getpid())); });
    return made;
  }();
  return folder;
}

inline void WriteScratch(const std::string& name, std::string_view bytes) {
  std::ofstream(ScratchFolder() / name, std::ios::binary) << bytes;
}
