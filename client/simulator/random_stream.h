#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

namespace mapkeep {

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): a 64-bit hash in which every input bit reaches every output
/// bit.
constexpr uint64_t HashBits(uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31);
}

/// A seed for one part of something seeded: the same part always gets the same one, whatever the other parts drew.
constexpr uint64_t SeedOf(uint64_t seed, uint64_t part) { return HashBits(seed ^ HashBits(part)); }

/// Four 16-bit uniforms summed and scaled: mean 0, variance 1, within 3.47. Cheap enough for one a ray.
constexpr float NormalFromBits(uint64_t bits) {
  const auto sum = static_cast<float>((bits & 0xffff) + (bits >> 16 & 0xffff) + (bits >> 32 & 0xffff) + (bits >> 48));
  constexpr float kMean = 2.0F * 65535;
  constexpr float kDeviation = 37836.9F;  // 65536 / sqrt(3)
  return (sum - kMean) / kDeviation;
}

/// A stream of random numbers from a seed, the same on every machine (the distributions of <random> are not).
class RandomStream {
 public:
  explicit RandomStream(uint64_t seed) : state_(seed) {}

  uint64_t Bits() { return HashBits(state_++ * 0xd1342543de82ef95U); }
  /// In [0, 1).
  double Uniform() { return static_cast<double>(Bits() >> 11) * 0x1p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  float UniformF(double low, double high) { return static_cast<float>(Uniform(low, high)); }
  /// Mean 0, deviation 1: the sum of twelve uniforms.
  double Normal() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += Uniform();
    return sum;
  }
  bool Chance(double probability) { return Uniform() < probability; }
  /// In [0, count); count > 0.
  size_t Index(size_t count) { return static_cast<size_t>(Bits() % count); }
  template <typename Values>
  void Shuffle(Values& values) {
    for (size_t i = values.size(); i > 1; --i) std::swap(values[i - 1], values[Index(i)]);
  }

 private:
  uint64_t state_;
};

}  // namespace mapkeep
