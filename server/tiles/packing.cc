#include "server/tiles/packing.h"

#include <isa-l/igzip_lib.h>
#include <zstd.h>

#include <vector>

namespace mapkeep {
namespace {

constexpr int kZstdLevel = 1;

std::string Gzipped(std::string_view body) {
  std::string packed;
  isal_zstream stream;
  isal_deflate_init(&stream);
  stream.gzip_flag = IGZIP_GZIP;
  stream.level = 1;
  std::vector<uint8_t> work(ISAL_DEF_LVL1_DEFAULT);
  stream.level_buf = work.data();
  stream.level_buf_size = static_cast<uint32_t>(work.size());
  stream.end_of_stream = 1;
  stream.flush = NO_FLUSH;
  // Deflate never grows more than this, with gzip's frame around it.
  packed.resize(body.size() + body.size() / 1000 * 5 + 1024);
  stream.next_in = reinterpret_cast<uint8_t*>(const_cast<char*>(body.data()));
  stream.avail_in = static_cast<uint32_t>(body.size());
  stream.next_out = reinterpret_cast<uint8_t*>(packed.data());
  stream.avail_out = static_cast<uint32_t>(packed.size());
  isal_deflate(&stream);
  packed.resize(packed.size() - stream.avail_out);
  packed.shrink_to_fit();
  return packed;
}

std::string Zstandard(std::string_view body) {
  std::string packed(ZSTD_compressBound(body.size()), '\0');
  const size_t size = ZSTD_compress(packed.data(), packed.size(), body.data(), body.size(), kZstdLevel);
  packed.resize(ZSTD_isError(size) ? 0 : size);
  packed.shrink_to_fit();
  return packed;
}

}  // namespace

std::string Packed(std::string_view body, Coding coding) {
  switch (coding) {
    case Coding::kGzip:
      return Gzipped(body);
    case Coding::kZstd:
      return Zstandard(body);
    case Coding::kIdentity:
      break;
  }
  return std::string(body);
}

}  // namespace mapkeep
