#include "storage/zstd.h"

#include <zstd.h>

#include <algorithm>
#include <memory>

#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr size_t kBlockOverhead = 32;  ///< more than a block adds to what it holds

struct FreeContext {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

}  // namespace

absl::StatusOr<std::string> Compress(const Parts& parts, int level) {
  // Making a context costs more than compressing a small block.
  thread_local const std::unique_ptr<ZSTD_CCtx, FreeContext> context(ZSTD_createCCtx());
  ZSTD_CCtx_reset(context.get(), ZSTD_reset_session_only);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, level);
  ZSTD_CCtx_setPledgedSrcSize(context.get(), parts.bytes.size());
  std::string frame(ZSTD_compressBound(parts.bytes.size()) + kBlockOverhead * (parts.ends.size() + 1), '\0');
  ZSTD_outBuffer out{frame.data(), frame.size(), 0};
  ZSTD_inBuffer in{parts.bytes.data(), 0, 0};
  for (size_t i = 0; i < std::max<size_t>(parts.ends.size(), 1); ++i) {
    const bool last = i + 1 >= parts.ends.size();
    in.size = last ? parts.bytes.size() : parts.ends[i];
    size_t left = 1;
    while (left != 0) {
      left = ZSTD_compressStream2(context.get(), &out, &in, last ? ZSTD_e_end : ZSTD_e_flush);
      if (ZSTD_isError(left) != 0) return absl::InternalError(Text("zstd: ", ZSTD_getErrorName(left)));
      if (left != 0 && out.pos == out.size) return absl::InternalError("zstd: a frame longer than its bound");
    }
  }
  frame.resize(out.pos);
  return frame;
}

absl::StatusOr<std::string> Decompress(std::string_view frame, size_t size) {
  if (ZSTD_getFrameContentSize(frame.data(), frame.size()) != size) {
    return absl::DataLossError(Text("the compressed frame does not hold ", size, " bytes"));
  }
  thread_local const std::unique_ptr<ZSTD_DCtx, FreeContext> context(ZSTD_createDCtx());
  std::string bytes(size, '\0');
  const size_t read = ZSTD_decompressDCtx(context.get(), bytes.data(), size, frame.data(), frame.size());
  if (ZSTD_isError(read) != 0) return absl::DataLossError(Text("zstd: ", ZSTD_getErrorName(read)));
  if (read != size) return absl::DataLossError(Text("the compressed frame ends after ", read, " bytes"));
  return bytes;
}

}  // namespace mapkeep
