#include "core/ratio_map/merge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "core/voxels/normal.h"

namespace mapkeep {
namespace {

constexpr int kStepsPerUnit = 64;
constexpr int kTableEnd = 16;  // exp(-16) is below any sensible alpha_min
constexpr double kMaxCount = std::numeric_limits<uint16_t>::max();
constexpr uint16_t kMinHits = kCountScale / 4;

// exp(-i / 64), at compile time from IEEE additions and multiplications alone: no machine's libm has a say.
constexpr auto kExponentials = [] {
  std::array<double, kStepsPerUnit * kTableEnd + 1> table{};
  double step = 1, term = 1;
  for (int n = 1; n < 20; ++n) {
    term *= -1.0 / kStepsPerUnit / n;
    step += term;
  }
  table[0] = 1;
  for (size_t i = 1; i < table.size(); ++i) table[i] = table[i - 1] * step;
  return table;
}();

// exp(-x) for x >= 0, linear between the table's entries.
double NegativeExponential(double x) {
  if (!(x < kTableEnd)) return kExponentials.back();
  const double at = x * kStepsPerUnit;
  const auto index = static_cast<size_t>(at);
  const double share = at - static_cast<double>(index);
  return kExponentials[index] + share * (kExponentials[index + 1] - kExponentials[index]);
}

// Of 0 to 2^51. Above 2^52 doubles are whole numbers, so that the sum is rounded as IEEE rounds, half to even; taking
// 2^52 off again is exact. (Without SSE 4.1 in the baseline std::floor and std::nearbyint are calls.)
double RoundHalfToEven(double value) {
  constexpr double kWholeNumbers = 4503599627370496.0;
  return (value + kWholeNumbers) - kWholeNumbers;
}

// Eq. 9's sums in 1/8 scan; halved together, before rounding, until both fit.
void SetCounts(Voxel& voxel, double hits, double exposures) {
  while (RoundHalfToEven(std::max(hits, exposures)) > kMaxCount) {
    hits /= 2;
    exposures /= 2;
  }
  voxel.hits = static_cast<uint16_t>(RoundHalfToEven(hits));
  voxel.exposures = static_cast<uint16_t>(RoundHalfToEven(exposures));
}

uint8_t WeightedByte(uint8_t a, double weight_a, uint8_t b, double weight_b) {
  if (a == b) return a;
  return static_cast<uint8_t>(RoundHalfToEven((a * weight_a + b * weight_b) / (weight_a + weight_b)));
}

std::array<uint8_t, 2> WeightedNormal(const std::array<uint8_t, 2>& a, double weight_a, const std::array<uint8_t, 2>& b,
                                      double weight_b) {
  if (a == b) return a;
  const Eigen::Vector3d normal_a = DecodeNormal(a), normal_b = DecodeNormal(b);
  if (normal_a.isZero()) return b;
  if (normal_b.isZero()) return a;
  const Eigen::Vector3d sum = weight_a * normal_a + weight_b * normal_b;
  constexpr double kCancelled = 0.1;
  if (sum.norm() < kCancelled * (weight_a + weight_b)) return weight_a > weight_b ? a : b;
  return EncodeNormal(sum.normalized());
}

// The fields other than the counts, of a session that hit the voxel; `weight` is alpha H_old, `hits` H_S, in one unit.
void MergeFields(Voxel& voxel, double weight, const SessionVoxel& session, double hits, uint32_t start_minutes) {
  for (int axis = 0; axis < 3; ++axis) {
    voxel.mean[axis] = WeightedByte(voxel.mean[axis], weight, session.mean[axis], hits);
  }
  voxel.normal = WeightedNormal(voxel.normal, weight, session.normal, hits);
  voxel.intensity = WeightedByte(voxel.intensity, weight, session.intensity, hits);
  voxel.ground = session.ground;
  voxel.mask = hits >= weight ? session.mask : voxel.mask | session.mask;
  voxel.first_seen = std::min(voxel.first_seen, start_minutes);
  voxel.last_seen = std::max(voxel.last_seen, start_minutes);
}

// The voxel after eq. 9, or nothing if it is dropped.
std::optional<Voxel> MergeVoxel(const Voxel& old, const SessionVoxel& session, const SessionMap& of,
                                const MergeParameters& parameters) {
  const double hits = double{kCountScale} * session.hits;
  const double exposures = double{kCountScale} * session.exposures;
  if (hits + exposures == 0) return old;
  const double alpha = IsContradicted(session, parameters)
                           ? parameters.contradicted_alpha
                           : DecayFactor((hits + exposures) / kCountScale, of.n_max, parameters);
  const double weight = alpha * old.hits;
  Voxel merged = old;
  SetCounts(merged, weight + hits, alpha * old.exposures + exposures);
  if (merged.hits < kMinHits) return std::nullopt;
  if (session.hits > 0) MergeFields(merged, weight, session, hits, of.start_minutes);
  return merged;
}

std::optional<Voxel> NewVoxel(const SessionVoxel& session, const SessionMap& of) {
  Voxel voxel{.position = PositionInBlock(session.key),
              .ground = session.ground,
              .mean = session.mean,
              .normal = session.normal,
              .intensity = session.intensity,
              .mask = session.mask,
              .first_seen = of.start_minutes,
              .last_seen = of.start_minutes};
  SetCounts(voxel, double{kCountScale} * session.hits, double{kCountScale} * session.exposures);
  if (voxel.hits < kMinHits) return std::nullopt;
  return voxel;
}

}  // namespace

bool IsContradicted(const SessionVoxel& session, const MergeParameters& parameters) {
  return parameters.contradicting_scans > 0 && session.hits == 0 &&
         session.exposures >= static_cast<uint32_t>(parameters.contradicting_scans);
}

double DecayFactor(double n_session, double n_max, const MergeParameters& parameters) {
  if (!(n_session > 0)) return parameters.alpha_max;
  if (!(n_max > 0)) return parameters.alpha_min;
  const double decay = NegativeExponential(std::max(0.0, parameters.gamma * n_session / n_max));
  return std::max(parameters.alpha_min, std::min(parameters.alpha_max, decay));
}

Block MergeBlock(const Block& old, std::span<const SessionVoxel> session, const SessionMap& of,
                 const MergeParameters& parameters) {
  Block merged{.key = old.key};
  merged.voxels.reserve(old.voxels.size() + session.size());
  auto next = old.voxels.begin();
  const auto keep = [&](const std::optional<Voxel>& voxel) {
    if (voxel) merged.voxels.push_back(*voxel);
  };
  for (const SessionVoxel& voxel : session) {
    const uint16_t position = PositionInBlock(voxel.key);
    for (; next != old.voxels.end() && next->position < position; ++next) keep(*next);
    if (next != old.voxels.end() && next->position == position) {
      keep(MergeVoxel(*next++, voxel, of, parameters));
    } else if (voxel.hits > 0) {
      keep(NewVoxel(voxel, of));
    }
  }
  for (; next != old.voxels.end(); ++next) keep(*next);
  return merged;
}

}  // namespace mapkeep
