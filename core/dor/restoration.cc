#include "core/dor/restoration.h"

#include <algorithm>

namespace mapkeep {
namespace {

// The finaliser of SplitMix64 (Steele et al., 2014): every input bit moves every output bit.
uint64_t Mixed(uint64_t value) {
  value += 0x9e3779b97f4a7c15U;
  value = (value ^ value >> 30) * 0xbf58476d1ce4e5b9U;
  value = (value ^ value >> 27) * 0x94d049bb133111ebU;
  return value ^ value >> 31;
}

}  // namespace

double RestorationProbability(double stability, double planarity) {
  return std::min(1.0, stability / 2 * (1 + planarity));
}

bool IsRestored(double probability, VoxelKey voxel, size_t point, uint64_t seed) {
  const uint64_t bits = Mixed(Mixed(Mixed(seed) ^ static_cast<uint64_t>(voxel)) ^ point);
  return static_cast<double>(bits >> 11) * 0x1p-53 < probability;
}

}  // namespace mapkeep
