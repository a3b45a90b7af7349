// A session in KITTI's layout of one scan. Input: poses.txt, times.txt and calib.txt, each ended by a zero byte, then
// the points.

#include <cstdint>
#include <cstdlib>

#include "client/readers/kitti.h"
#include "tests/fuzz/scratch_folder.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::string_view left(reinterpret_cast<const char*>(data), size);
  for (const char* name : {"poses.txt", "times.txt", "calib.txt"}) {
    const size_t end = std::min(left.find('\0'), left.size());
    WriteScratch(name, left.substr(0, end));
    left.remove_prefix(std::min(end + 1, left.size()));
  }
  WriteScratch("velodyne/000000.bin", left);
  const auto session = mapkeep::OpenKitti(ScratchFolder());
  if (!session.ok() || session->files.empty()) return 0;
  const auto scan = session->read_file(session->files[0]);
  if (scan.ok() && scan->points.size() != left.size() / 16) std::abort();
  return 0;
}
