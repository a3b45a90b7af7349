#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>

namespace mapkeep {

/// How the fields of a message lie one after the other.
enum class MessageEncoding : uint8_t {
  kRos1,   ///< packed, little-endian
  kCdr,    ///< ROS 2's: a header that says the byte order, then aligned fields; strings end in a zero
  kOther,  ///< not for us
};

/// Takes fields off a serialised message. Once it runs out, or is not as it should be, everything is zero and `ok`
/// false: check once, at the end.
class MessageCursor {
 public:
  MessageCursor(MessageEncoding encoding, std::string_view bytes)
      : cdr_(encoding == MessageEncoding::kCdr), rest_(bytes) {
    if (!cdr_) return;
    // Plain CDR, big-endian 0 or little-endian 1; lists of parameters and XCDR2 are others.
    if (rest_.size() < 4 || rest_[0] != 0 || (rest_[1] != 0 && rest_[1] != 1)) {
      ok_ = false;
    } else {
      swap_ = rest_[1] == 0;
      rest_.remove_prefix(4);
      begin_ = rest_.data();
    }
  }

  template <typename Number>
  Number Take() {
    Number number{};
    if (cdr_) Align(sizeof(Number));
    if (!ok_ || rest_.size() < sizeof(Number)) {
      Fail();
      return number;
    }
    char bytes[sizeof(Number)];
    std::memcpy(bytes, rest_.data(), sizeof(Number));
    if (swap_) {
      for (size_t i = 0; i < sizeof(Number) / 2; ++i) std::swap(bytes[i], bytes[sizeof(Number) - 1 - i]);
    }
    std::memcpy(&number, bytes, sizeof(Number));
    rest_.remove_prefix(sizeof(Number));
    return number;
  }

  std::string TakeString() {
    std::string_view text = TakeBytes(Take<uint32_t>());
    if (cdr_ && !text.empty() && text.back() == '\0') text.remove_suffix(1);
    return std::string(text);
  }

  /// Of a sequence of bytes whose length was taken.
  std::string_view TakeBytes(size_t count) {
    if (!ok_ || rest_.size() < count) {
      Fail();
      return {};
    }
    const std::string_view bytes = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return bytes;
  }

  bool ok() const { return ok_; }
  bool is_cdr() const { return cdr_; }
  size_t left() const { return rest_.size(); }

 private:
  void Align(size_t size) {
    const size_t over = static_cast<size_t>(rest_.data() - begin_) % size;
    if (ok_ && over != 0) TakeBytes(size - over);
  }
  void Fail() {
    ok_ = false;
    rest_ = {};
  }

  static_assert(std::endian::native == std::endian::little);
  const bool cdr_;
  bool swap_ = false;
  std::string_view rest_;
  const char* begin_ = rest_.data();
  bool ok_ = true;
};

}  // namespace mapkeep
