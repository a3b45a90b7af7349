#include "client/simulator/measurement.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "client/simulator/random_stream.h"

namespace mapkeep {
namespace {

constexpr float kMixedGap = 2.5F;     // metres: a pulse is about this long, farther echoes stay apart
constexpr float kMixedLeast = 0.3F;   // metres: closer than this is a slope, not an edge
constexpr float kGlassReturn = 0.2F;  // share of pulses that glass sends back
constexpr float kIntensityNoise = 0.02F;
constexpr float kMaxStretch = 0.10F;  // metres: most noise that a slanted surface adds
constexpr size_t kChunk = 4096;

/// 16 random bits as a number in [0, 1).
float UniformFromBits(uint64_t bits) { return static_cast<float>(bits & 0xffff) / 65536.0F; }

struct Return {
  float range = 0;  // 0: none
  float intensity = 0;
};

class Receiver {
 public:
  Receiver(const SensorModel& sensor, std::span<const RayHit> hits, uint64_t seed)
      : sensor_(sensor), hits_(hits), seed_(seed), channels_(sensor.elevations.size()) {
    // Half the pulses from a 10 % target at normal incidence come back from `reach`.
    half_power_ = 0.1F / static_cast<float>(sensor.reach * sensor.reach);
  }

  Return Receive(size_t ray) const {
    const RayHit& hit = hits_[ray];
    if (hit.instance == RayHit::kNothing) return {};
    const uint64_t chance = SeedOf(seed_, 2 * ray);
    const uint64_t noise = SeedOf(seed_, 2 * ray + 1);
    const float brightness = ReflectivityOf(hit.material) * std::sqrt(hit.incidence);
    const float power = brightness / (hit.range * hit.range) / half_power_;
    const float returned = power * power / (1 + power * power);  // a soft threshold, one half at power 1
    if (UniformFromBits(chance) >= returned * (1 - static_cast<float>(sensor_.drop_out))) return {};
    if (hit.material == Material::kGlass && UniformFromBits(chance >> 16) >= kGlassReturn) return {};
    const auto divergence = static_cast<float>(sensor_.divergence);
    const float spot = hit.range * divergence;
    const float slant = std::sqrt(std::max(0.0F, 1 - hit.incidence * hit.incidence)) / std::max(hit.incidence, 0.02F);
    const float stretch = std::min(kMaxStretch, 0.25F * spot * slant);
    const auto base = static_cast<float>(sensor_.range_noise);
    const float range =
        MixedRange(ray, chance >> 32) + std::sqrt(base * base + stretch * stretch) * NormalFromBits(noise);
    if (range < sensor_.min_range || range > sensor_.max_range) return {};
    const float intensity = brightness + kIntensityNoise * NormalFromBits(HashBits(noise));
    return {range, std::round(std::clamp(intensity, 0.0F, 1.0F) * 255) / 255};
  }

 private:
  /// The range of the hit, or of the mixture with the neighbouring firing's if the edge between them cuts the beam.
  float MixedRange(size_t ray, uint64_t bits) const {
    const float range = hits_[ray].range;
    const size_t next = ray + channels_;
    if (next >= hits_.size() || hits_[next].instance == RayHit::kNothing) return range;
    const float gap = std::abs(hits_[next].range - range);
    if (gap < kMixedLeast || gap > kMixedGap) return range;
    // The edge lies anywhere between the two firings; the beam is cut if it is within the divergence.
    const double step = sensor_.rosette ? 0.005 : 6.2832 / static_cast<double>(sensor_.firings);
    const float cut = std::min(0.5F, static_cast<float>(sensor_.divergence / step));
    const float where = UniformFromBits(bits);
    if (where >= cut) return range;
    const float share = 0.5F * UniformFromBits(bits >> 16);
    return range + share * (hits_[next].range - range);
  }

  const SensorModel& sensor_;
  std::span<const RayHit> hits_;
  uint64_t seed_;
  size_t channels_;
  float half_power_ = 0;
};

}  // namespace

LabelledScan Measure(const SensorModel& sensor, std::span<const Eigen::Vector3f> directions,
                     std::span<const RayHit> hits, std::span<const uint32_t> labels, uint64_t seed) {
  const Receiver receiver(sensor, hits, seed);
  std::vector<Return> returns(hits.size());
  tbb::parallel_for(tbb::blocked_range<size_t>(0, hits.size(), kChunk), [&](const tbb::blocked_range<size_t>& range) {
    for (size_t ray = range.begin(); ray != range.end(); ++ray) returns[ray] = receiver.Receive(ray);
  });
  LabelledScan measured;
  measured.scan.points.reserve(hits.size());
  measured.scan.intensities.reserve(hits.size());
  measured.labels.reserve(hits.size());
  for (size_t ray = 0; ray < hits.size(); ++ray) {
    if (returns[ray].range == 0) continue;
    measured.scan.points.emplace_back(returns[ray].range * directions[ray]);
    measured.scan.intensities.push_back(returns[ray].intensity);
    measured.labels.push_back(labels[hits[ray].instance]);
  }
  return measured;
}

}  // namespace mapkeep
