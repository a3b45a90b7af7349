#include "core/registration/descriptors.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace mapkeep {
namespace {

constexpr size_t kPaddedSize = 36;  // whole vectors of four floats
using Histogram = std::array<float, kPaddedSize>;

// The four products that fix the angles of a pair: with the unit line d, a = n1.d, b = n2.d, c = n1.n2,
// t = (d x n1).n2.
struct PairProducts {
  float a, b, c, t;
};

// atan(y / x) for 0 <= y <= x, to 1e-4 radians: far below the width of a bin.
float AtanOfRatio(float ratio) {
  const float square = ratio * ratio;
  return ratio *
         (0.99997726F +
          square * (-0.33262347F +
                    square * (0.19354346F + square * (-0.11643287F + square * (0.05265332F - square * 0.01172120F)))));
}

float FastAtan2(float y, float x) {
  const float ax = std::abs(x);
  const float ay = std::abs(y);
  const float larger = std::max(ax, ay);
  const float ratio = larger > 0 ? std::min(ax, ay) / larger : 0.0F;
  constexpr auto kPi = std::numbers::pi_v<float>;
  float angle = AtanOfRatio(ratio);
  angle = ay > ax ? kPi / 2 - angle : angle;
  angle = x < 0 ? kPi - angle : angle;
  return y < 0 ? -angle : angle;
}

int BinOf(float share) { return std::clamp(static_cast<int>(share * kFeatureBins), 0, kFeatureBins - 1); }

// The point whose normal is closer to the line is the source, so that both points see the same angles. Swapping turns
// (a, b) into (-b, -a) and leaves c and t.
PairBins BinsOf(const PairProducts& pair) {
  const bool swap = std::abs(pair.a) < std::abs(pair.b);
  const float a = swap ? -pair.b : pair.a;
  const float b = swap ? -pair.a : pair.b;
  // |d x n| of the frame (u = n, v = d x u, w = u x v); if the line is along the normal the frame is open: any will do.
  const float sine = std::sqrt(std::max(1 - a * a, 1e-12F));
  const float alpha = pair.t / sine;
  const float theta = FastAtan2((b - a * pair.c) / sine, pair.c);
  return {BinOf((alpha + 1) / 2), BinOf((a + 1) / 2), BinOf((theta / std::numbers::pi_v<float> + 1) / 2)};
}

PairProducts ProductsOf(const Eigen::Vector3f& line, const Eigen::Vector3f& first, const Eigen::Vector3f& second) {
  return {first.dot(line), second.dot(line), first.dot(second), line.cross(first).dot(second)};
}

// A cell's points and all that may be their neighbours, near the cell's own origin: float is enough there.
struct CellView {
  std::vector<PointRange> ranges;
  std::vector<Eigen::Vector3f> points;
  std::vector<uint32_t> indices;
  Eigen::Vector3d origin;
};

void Gather(const MatchCloud& cloud, size_t cell, CellView& view) {
  NeighbouringRanges(cloud.cell_keys, cloud.cell_begin, cell, view.ranges);
  view.origin = cloud.points[cloud.cell_begin[cell]];
  view.points.clear();
  view.indices.clear();
  for (const PointRange& range : view.ranges) {
    for (uint32_t i = range.begin; i < range.end; ++i) {
      view.points.emplace_back((cloud.points[i] - view.origin).cast<float>());
      view.indices.push_back(i);
    }
  }
}

// Calls visit(i, j, line, squared distance) for each point i of the cell and each neighbour j within the radius.
template <typename Visit>
void ForEachPair(const MatchCloud& cloud, size_t cell, float radius, const Visit& visit) {
  CellView view;
  Gather(cloud, cell, view);
  for (uint32_t i = cloud.cell_begin[cell]; i < cloud.cell_begin[cell + 1]; ++i) {
    const Eigen::Vector3f point = (cloud.points[i] - view.origin).cast<float>();
    for (size_t k = 0; k < view.points.size(); ++k) {
      const Eigen::Vector3f offset = view.points[k] - point;
      const float squared = offset.squaredNorm();
      if (squared < radius * radius && squared > 0) visit(i, view.indices[k], offset, squared);
    }
  }
}

// The simplified histogram: the shares of a point's own pairs.
void SimpleHistogramsOfCell(const MatchCloud& cloud, size_t cell, float radius, std::vector<Histogram>& simple) {
  ForEachPair(cloud, cell, radius, [&](uint32_t i, uint32_t j, const Eigen::Vector3f& offset, float squared) {
    const PairBins bins = BinsOf(ProductsOf(offset / std::sqrt(squared), cloud.normals[i], cloud.normals[j]));
    simple[i][bins.alpha] += 1;
    simple[i][kFeatureBins + bins.phi] += 1;
    simple[i][2 * kFeatureBins + bins.theta] += 1;
  });
  for (uint32_t i = cloud.cell_begin[cell]; i < cloud.cell_begin[cell + 1]; ++i) {
    float pairs = 0;
    for (int bin = 0; bin < kFeatureBins; ++bin) pairs += simple[i][bin];
    if (pairs == 0) continue;
    for (float& share : simple[i]) share /= pairs;
  }
}

Descriptor Quantised(const Histogram& histogram) {
  Descriptor descriptor{};
  for (int group = 0; group < kDescriptorSize; group += kFeatureBins) {
    float sum = 0;
    for (int bin = 0; bin < kFeatureBins; ++bin) sum += histogram[group + bin];
    if (!(sum > 0)) continue;
    for (int bin = 0; bin < kFeatureBins; ++bin) {
      descriptor[group + bin] = static_cast<uint8_t>(255 * histogram[group + bin] / sum + 0.5F);
    }
  }
  return descriptor;
}

// Rusu's weighted histogram: half from the point's own pairs, half from its neighbours' simple histograms. Weights fall
// with the square of the distance: at 1 / distance half as many right matches were left on the real data.
void DescribeCell(const MatchCloud& cloud, size_t cell, float radius, std::span<const Histogram> simple,
                  std::vector<Descriptor>& descriptors) {
  const uint32_t first = cloud.cell_begin[cell];
  const size_t count = cloud.cell_begin[cell + 1] - first;
  std::vector<Histogram> sums(count, Histogram{});
  std::vector<float> weights(count);
  ForEachPair(cloud, cell, radius, [&](uint32_t i, uint32_t j, const Eigen::Vector3f&, float squared) {
    const float weight = 1 / squared;
    Histogram& sum = sums[i - first];
    const Histogram& other = simple[j];
    weights[i - first] += weight;
    for (size_t bin = 0; bin < kPaddedSize; ++bin) sum[bin] += weight * other[bin];
  });
  for (size_t i = 0; i < count; ++i) {
    if (weights[i] == 0) continue;
    for (size_t bin = 0; bin < kPaddedSize; ++bin)
      sums[i][bin] = (simple[first + i][bin] + sums[i][bin] / weights[i]) / 2;
    descriptors[first + i] = Quantised(sums[i]);
  }
}

}  // namespace

PairBins BinsOfPair(const Eigen::Vector3f& line, const Eigen::Vector3f& first_normal,
                    const Eigen::Vector3f& second_normal) {
  return BinsOf(ProductsOf(line, first_normal, second_normal));
}

std::vector<Descriptor> DescribePoints(const MatchCloud& cloud, double radius) {
  const auto metres = static_cast<float>(std::min<double>(radius, kCellVoxels) * cloud.voxel_size);
  std::vector<Histogram> simple(cloud.points.size(), Histogram{});
  std::vector<Descriptor> descriptors(cloud.points.size());
  tbb::parallel_for(size_t{0}, cloud.cell_keys.size(),
                    [&](size_t cell) { SimpleHistogramsOfCell(cloud, cell, metres, simple); });
  tbb::parallel_for(size_t{0}, cloud.cell_keys.size(),
                    [&](size_t cell) { DescribeCell(cloud, cell, metres, simple, descriptors); });
  return descriptors;
}

double FlatnessOf(const Descriptor& descriptor) {
  constexpr int kMiddle = kFeatureBins / 2;
  if (std::all_of(descriptor.begin(), descriptor.end(), [](uint8_t byte) { return byte == 0; })) return 1;
  const int sum = descriptor[kMiddle] + descriptor[kFeatureBins + kMiddle] + descriptor[2 * kFeatureBins + kMiddle];
  return sum / (3 * 255.0);
}

}  // namespace mapkeep
