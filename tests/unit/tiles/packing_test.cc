#include "server/tiles/packing.h"

#include <gtest/gtest.h>
#include <isa-l/igzip_lib.h>
#include <zstd.h>

#include <random>
#include <string>

namespace mapkeep {
namespace {

std::string Body(size_t size, bool random_bytes) {
  std::mt19937 random(5);
  std::string body(size, '\0');
  for (size_t i = 0; i < size; ++i) body[i] = static_cast<char>(random_bytes ? random() : i / 100);
  return body;
}

std::string Unzipped(const std::string& packed, size_t size) {
  std::string body(size + 1, '\0');
  inflate_state state;
  isal_inflate_init(&state);
  state.crc_flag = ISAL_GZIP;
  state.next_in = reinterpret_cast<uint8_t*>(const_cast<char*>(packed.data()));
  state.avail_in = static_cast<uint32_t>(packed.size());
  state.next_out = reinterpret_cast<uint8_t*>(body.data());
  state.avail_out = static_cast<uint32_t>(body.size());
  EXPECT_EQ(isal_inflate(&state), ISAL_DECOMP_OK);
  EXPECT_EQ(state.block_state, ISAL_BLOCK_FINISH);
  body.resize(body.size() - state.avail_out);
  return body;
}

TEST(Packing, WhatWasPackedComesBack) {
  for (const size_t size : {0, 1, 1000, 300000, 5000000}) {
    for (const bool random_bytes : {false, true}) {
      const std::string body = Body(size, random_bytes);
      EXPECT_EQ(Packed(body, Coding::kIdentity), body);
      EXPECT_TRUE(Unzipped(Packed(body, Coding::kGzip), size) == body) << size << random_bytes;
      const std::string packed = Packed(body, Coding::kZstd);
      std::string back(size, '\0');
      EXPECT_EQ(ZSTD_decompress(back.data(), back.size(), packed.data(), packed.size()), size);
      EXPECT_TRUE(back == body) << size << random_bytes;
    }
  }
  EXPECT_LT(Packed(Body(300000, false), Coding::kGzip).size(), 30000U);
}

}  // namespace
}  // namespace mapkeep
