#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/registration/descriptors.h"

namespace mapkeep {

/// A descriptor in 16-bit lanes, padded to whole vectors, so that a distance is a handful of instructions.
struct alignas(16) DescriptorRow {
  std::array<int16_t, 40> lanes{};
};

DescriptorRow RowOf(const Descriptor& descriptor);
/// Squared Euclidean distance: exact.
int32_t SquaredDistance(const DescriptorRow& a, const DescriptorRow& b);

/// Typical descriptors ("words") that divide all others by the nearest word: k-means in whole numbers, so that the same
/// descriptors give the same words on any number of threads. Empty only if there are no descriptors.
struct Codebook {
  std::vector<DescriptorRow> words;
};
Codebook LearnCodebook(std::span<const Descriptor> descriptors);

/// Finds the nearest among many descriptors by looking only at those whose words are nearest to the query (an inverted
/// file): cost grows with the square root of their number. Queries may come from several threads at once.
class DescriptorIndex {
 public:
  struct Nearest {
    uint32_t index = 0;
    int32_t squared = 0;         ///< distance to it
    int32_t second_squared = 0;  ///< to the next; the largest int32_t if there is none
  };

  DescriptorIndex(std::span<const Descriptor> descriptors, std::shared_ptr<const Codebook> codebook);

  const std::shared_ptr<const Codebook>& codebook() const { return codebook_; }

  /// The nearest two among the descriptors of the `probes` words nearest to the query; of equals the first. Nothing if
  /// there are none.
  std::optional<Nearest> Find(const DescriptorRow& query, size_t probes) const;
  /// The same among the descriptors that `admit` says yes to.
  std::optional<Nearest> Find(const DescriptorRow& query, size_t probes,
                              const std::function<bool(uint32_t index)>& admit) const;

 private:
  template <typename Admit>
  std::optional<Nearest> FindAdmitted(const DescriptorRow& query, size_t probes, const Admit& admit) const;

  std::shared_ptr<const Codebook> codebook_;
  std::vector<uint32_t> begin_;      // of each word's entries, and one past the last
  std::vector<uint32_t> indices_;    // of the descriptors, by word, ascending in a word
  std::vector<DescriptorRow> rows_;  // in the order of indices_
};

}  // namespace mapkeep
