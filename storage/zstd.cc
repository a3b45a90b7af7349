#include "storage/zstd.h"

#include <zstd.h>

#include <memory>

#include "storage/text.h"

namespace mapkeep {
namespace {

struct FreeContext {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

}  // namespace

absl::StatusOr<std::string> Compress(std::string_view bytes, int level) {
  // Making a context costs more than compressing a small block.
  thread_local const std::unique_ptr<ZSTD_CCtx, FreeContext> context(ZSTD_createCCtx());
  std::string frame(ZSTD_compressBound(bytes.size()), '\0');
  const size_t size = ZSTD_compressCCtx(context.get(), frame.data(), frame.size(), bytes.data(), bytes.size(), level);
  if (ZSTD_isError(size) != 0) return absl::InternalError(Text("zstd: ", ZSTD_getErrorName(size)));
  frame.resize(size);
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
