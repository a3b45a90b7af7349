#include "core/registration/pruning.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace mapkeep {
namespace {

// The pairs' coordinates by column, relative to the first pair, so that float is exact enough and rows run in vectors.
struct Columns {
  std::array<std::vector<float>, 3> source, target;
};

Columns ColumnsOf(std::span<const PointPair> pairs, size_t padded) {
  Columns columns;
  for (int axis = 0; axis < 3; ++axis) {
    columns.source[axis].resize(padded);
    columns.target[axis].resize(padded);
    for (size_t i = 0; i < pairs.size(); ++i) {
      columns.source[axis][i] = static_cast<float>(pairs[i].source[axis] - pairs[0].source[axis]);
      columns.target[axis][i] = static_cast<float>(pairs[i].target[axis] - pairs[0].target[axis]);
    }
  }
  return columns;
}

// The bits of 64 pairs from `begin` on that go with pair i.
uint64_t WordOf(const Columns& columns, size_t i, size_t begin, float tolerance) {
  const auto squared_distance = [i](const std::array<std::vector<float>, 3>& c, size_t j) {
    const float dx = c[0][j] - c[0][i];
    const float dy = c[1][j] - c[1][i];
    const float dz = c[2][j] - c[2][i];
    return dx * dx + dy * dy + dz * dz;
  };
  std::array<float, 64> apart;
  for (size_t k = 0; k < 64; ++k) {
    apart[k] = std::abs(std::sqrt(squared_distance(columns.source, begin + k)) -
                        std::sqrt(squared_distance(columns.target, begin + k)));
  }
  uint64_t word = 0;
  for (size_t k = 0; k < 64; ++k) word |= static_cast<uint64_t>(apart[k] < tolerance) << k;
  return word;
}

}  // namespace

CompatibilityGraph::CompatibilityGraph(std::span<const PointPair> pairs, double noise_bound)
    : size_(pairs.size()), words_((pairs.size() + 63) / 64), bits_(size_ * words_) {
  const Columns columns = ColumnsOf(pairs, words_ * 64);
  const auto tolerance = static_cast<float>(2 * noise_bound);
  const uint64_t last_mask = size_ % 64 == 0 ? ~uint64_t{0} : (uint64_t{1} << (size_ % 64)) - 1;
  tbb::parallel_for(size_t{0}, size_, [&](size_t i) {
    uint64_t* row = bits_.data() + i * words_;
    for (size_t word = 0; word < words_; ++word) row[word] = WordOf(columns, i, word * 64, tolerance);
    row[words_ - 1] &= last_mask;
    row[i / 64] &= ~(uint64_t{1} << (i % 64));
  });
}

std::vector<uint32_t> LargestCore(const CompatibilityGraph& graph, std::span<const uint8_t> alive) {
  const size_t size = graph.size();
  const size_t words = (size + 63) / 64;
  std::vector<uint64_t> left(words);
  for (size_t v = 0; v < size; ++v) left[v / 64] |= static_cast<uint64_t>(alive[v] != 0) << (v % 64);

  std::vector<uint32_t> degrees(size);
  std::vector<std::vector<uint32_t>> by_degree(size);  // may hold outdated entries: a vertex moves by being added again
  for (uint32_t v = 0; v < size; ++v) {
    if (alive[v] == 0) continue;
    const auto row = graph.Row(v);
    for (size_t word = 0; word < words; ++word) degrees[v] += std::popcount(row[word] & left[word]);
    by_degree[degrees[v]].push_back(v);
  }

  std::vector<uint32_t> cores(size);
  uint32_t k = 0;
  for (uint32_t degree = 0; degree < size;) {
    if (by_degree[degree].empty()) {
      ++degree;
      continue;
    }
    const uint32_t v = by_degree[degree].back();
    by_degree[degree].pop_back();
    if ((left[v / 64] >> (v % 64) & 1) == 0 || degrees[v] != degree) continue;
    k = std::max(k, degree);
    cores[v] = k;
    left[v / 64] &= ~(uint64_t{1} << (v % 64));
    const auto row = graph.Row(v);
    for (size_t word = 0; word < words; ++word) {
      for (uint64_t bits = row[word] & left[word]; bits != 0; bits &= bits - 1) {
        const auto other = static_cast<uint32_t>(word * 64 + std::countr_zero(bits));
        by_degree[--degrees[other]].push_back(other);
      }
    }
    degree = degree == 0 ? 0 : degree - 1;
  }

  std::vector<uint32_t> core;
  for (uint32_t v = 0; k > 0 && v < size; ++v) {
    if (cores[v] == k) core.push_back(v);
  }
  return core;
}

}  // namespace mapkeep
