#include "core/registration/matching.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <tuple>

namespace mapkeep {
namespace {

// The nearest target of query i if it is distinctive enough; ratio 1 if not.
Match MatchOf(uint32_t i, const Descriptor& query, const DescriptorIndex& index, const MatchingParameters& parameters,
              const AdmitMatch& admit) {
  const auto nearest =
      admit ? index.Find(RowOf(query), parameters.probes, [&](uint32_t target) { return admit(i, target); })
            : index.Find(RowOf(query), parameters.probes);
  if (!nearest || nearest->squared >= parameters.max_ratio * nearest->second_squared) return {.source = i};
  return {i, nearest->index, static_cast<float>(nearest->squared) / static_cast<float>(nearest->second_squared)};
}

}  // namespace

std::vector<Match> MatchDescriptors(std::span<const Descriptor> source, std::span<const Descriptor> target,
                                    const DescriptorIndex& target_index, const MatchingParameters& parameters,
                                    const AdmitMatch& admit) {
  const size_t queries = std::min(source.size(), parameters.max_queries);
  std::vector<Match> matches(queries);
  tbb::parallel_for(size_t{0}, queries, [&](size_t k) {
    const auto i = static_cast<uint32_t>(k * source.size() / queries);
    matches[k] = MatchOf(i, source[i], target_index, parameters, admit);
  });
  std::erase_if(matches, [](const Match& match) { return match.ratio >= 1; });

  // The words of the target divide the source as well.
  const DescriptorIndex source_index(source, target_index.codebook());
  std::vector<uint8_t> mutual(matches.size());
  tbb::parallel_for(size_t{0}, matches.size(), [&](size_t k) {
    const DescriptorRow row = RowOf(target[matches[k].target]);
    const auto back =
        admit ? source_index.Find(row, parameters.probes, [&](uint32_t from) { return admit(from, matches[k].target); })
              : source_index.Find(row, parameters.probes);
    mutual[k] = back && back->index == matches[k].source ? 1 : 0;
  });
  size_t kept = 0;
  for (size_t k = 0; k < matches.size(); ++k) {
    if (mutual[k] != 0) matches[kept++] = matches[k];
  }
  matches.resize(kept);
  std::sort(matches.begin(), matches.end(),
            [](const Match& a, const Match& b) { return std::tie(a.ratio, a.source) < std::tie(b.ratio, b.source); });
  if (matches.size() > parameters.max_matches) matches.resize(parameters.max_matches);
  return matches;
}

}  // namespace mapkeep
