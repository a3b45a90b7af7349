#include "core/registration/descriptor_index.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace mapkeep {
namespace {

constexpr size_t kMaxWords = 512;
constexpr size_t kSamplesPerWord = 64;
constexpr int kRounds = 6;
constexpr size_t kMaxProbes = 64;

uint32_t NearestWord(const DescriptorRow& row, const Codebook& codebook) {
  int32_t least = std::numeric_limits<int32_t>::max();
  uint32_t nearest = 0;
  for (uint32_t word = 0; word < codebook.words.size(); ++word) {
    const int32_t squared = SquaredDistance(row, codebook.words[word]);
    if (squared < least) {
      least = squared;
      nearest = word;
    }
  }
  return nearest;
}

// Moves each word to the mean of the rows nearest to it; one with none stays.
void MoveWords(std::span<const DescriptorRow> rows, std::span<const uint32_t> nearest, Codebook& codebook) {
  std::vector<std::array<int32_t, kDescriptorSize>> sums(codebook.words.size(), std::array<int32_t, kDescriptorSize>{});
  std::vector<int32_t> counts(codebook.words.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    for (int lane = 0; lane < kDescriptorSize; ++lane) sums[nearest[i]][lane] += rows[i].lanes[lane];
    ++counts[nearest[i]];
  }
  for (size_t word = 0; word < counts.size(); ++word) {
    if (counts[word] == 0) continue;
    for (int lane = 0; lane < kDescriptorSize; ++lane) {
      codebook.words[word].lanes[lane] = static_cast<int16_t>((sums[word][lane] + counts[word] / 2) / counts[word]);
    }
  }
}

}  // namespace

DescriptorRow RowOf(const Descriptor& descriptor) {
  DescriptorRow row;
  std::copy(descriptor.begin(), descriptor.end(), row.lanes.begin());
  return row;
}

int32_t SquaredDistance(const DescriptorRow& a, const DescriptorRow& b) {
  int32_t sum = 0;
  for (size_t lane = 0; lane < a.lanes.size(); ++lane) {
    const auto apart = static_cast<int16_t>(a.lanes[lane] - b.lanes[lane]);
    sum += apart * apart;
  }
  return sum;
}

Codebook LearnCodebook(std::span<const Descriptor> descriptors) {
  if (descriptors.empty()) return {};
  const auto root = static_cast<size_t>(std::sqrt(static_cast<double>(descriptors.size())));
  const size_t words = std::clamp<size_t>(root, 1, kMaxWords);
  const size_t samples = std::min(words * kSamplesPerWord, descriptors.size());
  std::vector<DescriptorRow> rows(samples);
  for (size_t i = 0; i < samples; ++i) rows[i] = RowOf(descriptors[i * descriptors.size() / samples]);

  Codebook codebook;
  codebook.words.resize(words);
  for (size_t word = 0; word < words; ++word) codebook.words[word] = rows[word * samples / words];
  std::vector<uint32_t> nearest(samples);
  for (int round = 0; round < kRounds; ++round) {
    tbb::parallel_for(size_t{0}, samples, [&](size_t i) { nearest[i] = NearestWord(rows[i], codebook); });
    MoveWords(rows, nearest, codebook);
  }
  return codebook;
}

DescriptorIndex::DescriptorIndex(std::span<const Descriptor> descriptors, std::shared_ptr<const Codebook> codebook)
    : codebook_(std::move(codebook)),
      begin_(codebook_->words.size() + 1),
      indices_(descriptors.size()),
      rows_(descriptors.size()) {
  if (codebook_->words.empty()) return;
  std::vector<uint32_t> words(descriptors.size());
  tbb::parallel_for(size_t{0}, descriptors.size(),
                    [&](size_t i) { words[i] = NearestWord(RowOf(descriptors[i]), *codebook_); });
  for (const uint32_t word : words) ++begin_[word + 1];
  for (size_t word = 1; word < begin_.size(); ++word) begin_[word] += begin_[word - 1];
  std::vector<uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (uint32_t i = 0; i < words.size(); ++i) {
    const uint32_t place = next[words[i]]++;
    indices_[place] = i;
    rows_[place] = RowOf(descriptors[i]);
  }
}

template <typename Admit>
std::optional<DescriptorIndex::Nearest> DescriptorIndex::FindAdmitted(const DescriptorRow& query, size_t probes,
                                                                      const Admit& admit) const {
  const std::span<const DescriptorRow> words = codebook_->words;
  std::array<std::pair<int32_t, uint32_t>, kMaxWords> order;
  for (uint32_t word = 0; word < words.size(); ++word) order[word] = {SquaredDistance(query, words[word]), word};
  const size_t probed = std::min({probes, words.size(), kMaxProbes});
  std::partial_sort(order.begin(), order.begin() + probed, order.begin() + words.size());

  constexpr int32_t kFar = std::numeric_limits<int32_t>::max();
  Nearest best{.squared = kFar, .second_squared = kFar};
  for (size_t k = 0; k < probed; ++k) {
    const uint32_t word = order[k].second;
    for (uint32_t i = begin_[word]; i < begin_[word + 1]; ++i) {
      const int32_t squared = SquaredDistance(query, rows_[i]);
      if (squared >= best.second_squared && squared != best.squared) continue;
      if (!admit(indices_[i])) continue;
      if (squared < best.squared || (squared == best.squared && indices_[i] < best.index)) {
        best = {indices_[i], squared, best.squared};
      } else {
        best.second_squared = std::min(best.second_squared, squared);
      }
    }
  }
  if (best.squared == kFar) return std::nullopt;
  return best;
}

std::optional<DescriptorIndex::Nearest> DescriptorIndex::Find(const DescriptorRow& query, size_t probes) const {
  return FindAdmitted(query, probes, [](uint32_t) { return true; });
}

std::optional<DescriptorIndex::Nearest> DescriptorIndex::Find(const DescriptorRow& query, size_t probes,
                                                              const std::function<bool(uint32_t index)>& admit) const {
  return FindAdmitted(query, probes, admit);
}

}  // namespace mapkeep
