// A PCD file.

#include <cstdint>
#include <cstdlib>

#include "client/readers/pcd_file.h"
#include "tests/fuzz/scratch_folder.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  WriteScratch("scan.pcd", {reinterpret_cast<const char*>(data), size});
  const auto scan = mapkeep::ReadPcdPoints(ScratchFolder() / "scan.pcd");
  if (scan.ok() && !scan->intensities.empty() && scan->intensities.size() != scan->points.size()) std::abort();
  return 0;
}
