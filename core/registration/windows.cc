#include "core/registration/windows.h"

#include <algorithm>

namespace mapkeep {
namespace {

size_t LastScanOf(size_t first, std::span<const Pose> poses, const AlignParameters& parameters) {
  const auto scans = static_cast<size_t>(std::max(parameters.window_scans, 1));
  const size_t end = std::min(first + scans, poses.size());
  double travel = 0;
  size_t last = first;
  while (last + 1 < end) {
    travel += (poses[last + 1].translation() - poses[last].translation()).norm();
    if (travel > parameters.window_travel) break;
    ++last;
  }
  return last;
}

}  // namespace

std::vector<Window> WindowsOf(std::span<const Pose> poses, const AlignParameters& parameters) {
  std::vector<Window> windows;
  for (size_t first = 0; first < poses.size();) {
    const Window window{first, LastScanOf(first, poses, parameters)};
    windows.push_back(window);
    if (window.last + 1 == poses.size()) break;
    const size_t half = (window.last - window.first + 2) / 2;
    first += std::min(half, static_cast<size_t>(std::max(parameters.window_stride, 1)));
  }
  return windows;
}

}  // namespace mapkeep
