#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <utility>

namespace mapkeep {

/// 128 bits that tell contents apart without looking at them: made of the identities of the values that they come from,
/// which are random where they differ. The same in every daemon.
struct ContentId {
  uint64_t high = 0, low = 0;
  auto operator<=>(const ContentId&) const = default;

  /// 32 hexadecimal digits.
  std::string Hex() const;

  template <typename H>
  friend H AbslHashValue(H h, const ContentId& id) {
    return H::combine(std::move(h), id.high, id.low);
  }
};

/// Makes an id of numbers; their order counts.
class ContentIdMaker {
 public:
  ContentIdMaker& Add(uint64_t number);
  ContentIdMaker& Add(const ContentId& id) { return Add(id.high).Add(id.low); }
  ContentId id() const { return id_; }

 private:
  ContentId id_{0x243f6a8885a308d3U, 0x13198a2e03707344U};  // digits of pi: any will do
};

}  // namespace mapkeep
