#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace mapkeep {

/// Appends `count` numbers of `kBytes` bytes as planes: the lowest byte of each, then the next one of each, and so on.
template <size_t kBytes, typename Get>
void AppendPlanes(std::string& out, size_t count, Get get) {
  const size_t begin = out.size();
  out.resize(begin + kBytes * count);
  char* const planes = out.data() + begin;
  for (size_t i = 0; i < count; ++i) {
    uint64_t rest = get(i);
    for (size_t plane = 0; plane < kBytes; ++plane, rest >>= 8) planes[plane * count + i] = static_cast<char>(rest);
  }
}

/// Reads back what AppendPlanes wrote, calling set(i, number); gives the position after it.
template <size_t kBytes, typename Set>
const char* ReadPlanes(const char* planes, size_t count, Set set) {
  for (size_t i = 0; i < count; ++i) {
    uint64_t number = 0;
    for (size_t plane = 0; plane < kBytes; ++plane) {
      number |= static_cast<uint64_t>(static_cast<unsigned char>(planes[plane * count + i])) << (8 * plane);
    }
    set(i, number);
  }
  return planes + kBytes * count;
}

/// `kBytes` little-endian bytes.
template <size_t kBytes>
void AppendNumber(std::string& out, uint64_t number) {
  AppendPlanes<kBytes>(out, 1, [number](size_t) { return number; });
}

template <size_t kBytes>
uint64_t NumberAt(const char* bytes) {
  uint64_t number = 0;
  ReadPlanes<kBytes>(bytes, 1, [&number](size_t, uint64_t read) { number = read; });
  return number;
}

}  // namespace mapkeep
