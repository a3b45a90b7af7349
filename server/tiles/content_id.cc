#include "server/tiles/content_id.h"

#include <absl/strings/str_format.h>

namespace mapkeep {
namespace {

// The finaliser of SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", 2014).
uint64_t Mixed(uint64_t value) {
  value = (value ^ value >> 30) * 0xbf58476d1ce4e5b9U;
  value = (value ^ value >> 27) * 0x94d049bb133111ebU;
  return value ^ value >> 31;
}

}  // namespace

std::string ContentId::Hex() const { return absl::StrFormat("%016x%016x", high, low); }

ContentIdMaker& ContentIdMaker::Add(uint64_t number) {
  id_.high = Mixed(id_.high + number + 0x9e3779b97f4a7c15U);
  id_.low = Mixed((id_.low ^ number) + 0xd1b54a32d192ed03U);
  return *this;
}

}  // namespace mapkeep
