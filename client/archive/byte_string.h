#pragma once

#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <string_view>

namespace mapkeep {

static_assert(std::endian::native == std::endian::little, "archives are little-endian");

template <typename Number>
void PutNumber(std::string* bytes, Number number) {
  bytes->append(reinterpret_cast<const char*>(&number), sizeof(number));
}

/// Takes numbers off the front of bytes; once they run out, everything is zero and `ok` false.
class ByteCursor {
 public:
  explicit ByteCursor(std::string_view bytes) : rest_(bytes) {}

  template <typename Number>
  Number Take() {
    Number number{};
    if (rest_.size() < sizeof(number)) {
      ok_ = false;
      rest_ = {};
      return number;
    }
    std::memcpy(&number, rest_.data(), sizeof(number));
    rest_.remove_prefix(sizeof(number));
    return number;
  }

  bool ok() const { return ok_; }
  size_t left() const { return rest_.size(); }

 private:
  std::string_view rest_;
  bool ok_ = true;
};

}  // namespace mapkeep
