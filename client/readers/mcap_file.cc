#include "client/readers/mcap_file.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>
#include <system_error>
#include <utility>

#include "client/readers/message_cursor.h"
#include "client/readers/recording.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
constexpr size_t kRecordHead = 1 + 8;
constexpr uint64_t kMostChunkBytes = uint64_t{1} << 30;
enum Opcode : uint8_t { kFooter = 2, kSchema = 3, kChannel = 4, kMessage = 5, kChunk = 6 };
constexpr size_t kMessageHead = 2 + 4 + 8 + 8;

/// The numbers of MCAP are packed and little-endian, as ROS 1's are.
MessageCursor CursorOf(std::string_view bytes) { return {MessageEncoding::kRos1, bytes}; }

absl::Status UnpackZstd(std::string_view packed, std::string* out) {
  const size_t got = ZSTD_decompress(out->data(), out->size(), packed.data(), packed.size());
  if (ZSTD_isError(got) != 0) return absl::InvalidArgumentError(absl::StrCat("zstd: ", ZSTD_getErrorName(got)));
  if (got != out->size()) return absl::InvalidArgumentError("zstd gave another size than the chunk announces");
  return absl::OkStatus();
}

absl::Status UnpackLz4(std::string_view packed, std::string* out) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) {
    return absl::InternalError("LZ4 could not begin");
  }
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> held(context,
                                                                                  LZ4F_freeDecompressionContext);
  size_t done = 0;
  while (!packed.empty()) {
    size_t into = out->size() - done, from = packed.size();
    const size_t hint = LZ4F_decompress(context, out->data() + done, &into, packed.data(), &from, nullptr);
    if (LZ4F_isError(hint) != 0) return absl::InvalidArgumentError(absl::StrCat("LZ4: ", LZ4F_getErrorName(hint)));
    done += into;
    packed.remove_prefix(from);
    if (hint == 0 || (into == 0 && from == 0)) break;
  }
  if (done != out->size()) return absl::InvalidArgumentError("LZ4 gave another size than the chunk announces");
  return absl::OkStatus();
}

}  // namespace

/// What is known while the file is read through.
struct McapFile::Parser {
  const McapFile& file;
  const Visit& visit;
  absl::flat_hash_map<uint16_t, std::string> schemas = {};
  absl::flat_hash_map<uint16_t, McapChannel> channels = {};

  /// A record outside a chunk, or inside the one at `record`; `offset` is where its content begins there.
  absl::Status Take(uint8_t opcode, std::string_view content, uint64_t record, uint64_t offset, bool in_chunk) {
    MessageCursor cursor = CursorOf(content);
    if (opcode == kSchema) {
      const auto id = cursor.Take<uint16_t>();
      schemas[id] = cursor.TakeString();
    } else if (opcode == kChannel) {
      const auto id = cursor.Take<uint16_t>(), schema = cursor.Take<uint16_t>();
      McapChannel channel{.topic = cursor.TakeString(), .schema = {}, .encoding = {}};
      channel.encoding = cursor.TakeString();
      const auto known = schemas.find(schema);
      if (known != schemas.end()) channel.schema = known->second;
      channels[id] = std::move(channel);
    } else if (opcode == kMessage) {
      const auto id = cursor.Take<uint16_t>();
      cursor.Take<uint32_t>();
      const auto log_time = cursor.Take<uint64_t>();
      cursor.Take<uint64_t>();
      const auto channel = channels.find(id);
      if (!cursor.ok() || channel == channels.end()) return file.At(record, "a message belongs to no channel");
      visit(channel->second, {.channel = id,
                              .log_time = log_time,
                              .record = record,
                              .offset = offset + kMessageHead,
                              .bytes = cursor.left(),
                              .in_chunk = in_chunk});
    }
    return cursor.ok() ? absl::OkStatus() : file.At(record, "a record ends early");
  }

  absl::Status TakeChunk(uint64_t record, std::string_view content) {
    const absl::StatusOr<std::string> records = file.Unpack(record, content);
    if (!records.ok()) return records.status();
    MessageCursor cursor = CursorOf(*records);
    while (cursor.left() > 0) {
      const auto opcode = cursor.Take<uint8_t>();
      const auto length = cursor.Take<uint64_t>();
      const uint64_t offset = records->size() - cursor.left();
      const std::string_view inside = cursor.TakeBytes(length);
      if (!cursor.ok()) return file.At(record, "a record in the chunk ends early");
      if (absl::Status status = Take(opcode, inside, record, offset, true); !status.ok()) return status;
    }
    return absl::OkStatus();
  }
};

absl::Status McapFile::At(uint64_t byte, absl::string_view what) const {
  return absl::InvalidArgumentError(absl::StrFormat("%s: at byte %d: %s", path_.string(), byte, what));
}

absl::StatusOr<std::string> McapFile::ReadBytes(uint64_t offset, uint64_t count) const {
  if (offset + count > size_) {
    return At(offset, "the file ends early: the recording was broken off; `mcap recover` mends it");
  }
  std::string bytes(count, '\0');
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(offset));
  if (!stream_.read(bytes.data(), static_cast<std::streamsize>(count))) {
    return At(offset, absl::StrCat("cannot be read: ", std::strerror(errno)));
  }
  return bytes;
}

absl::StatusOr<std::string> McapFile::Unpack(uint64_t record, std::string_view content) const {
  MessageCursor cursor = CursorOf(content);
  cursor.Take<uint64_t>();
  cursor.Take<uint64_t>();
  const auto size = cursor.Take<uint64_t>();
  const auto crc = cursor.Take<uint32_t>();
  const std::string compression = cursor.TakeString();
  const std::string_view packed = cursor.TakeBytes(cursor.Take<uint64_t>());
  if (!cursor.ok()) return At(record, "a chunk ends early");
  if (size > kMostChunkBytes) return At(record, "a chunk announces more than 1 GiB");
  std::string records;
  absl::Status unpacked;
  if (compression.empty()) {
    records = packed;
  } else {
    records.resize(size);
    if (compression == "zstd") {
      unpacked = UnpackZstd(packed, &records);
    } else if (compression == "lz4") {
      unpacked = UnpackLz4(packed, &records);
    } else {
      return At(record, absl::StrFormat("a chunk is compressed by '%s': expected zstd, lz4 or nothing",
                                        compression.substr(0, 40)));
    }
  }
  if (!unpacked.ok()) return At(record, unpacked.message());
  if (crc != 0 && crc32(0, reinterpret_cast<const Bytef*>(records.data()), static_cast<uInt>(records.size())) != crc) {
    return At(record, "the chunk's checksum is wrong");
  }
  return records;
}

absl::StatusOr<std::unique_ptr<McapFile>> McapFile::Open(const fs::path& path, const Visit& visit) {
  std::unique_ptr<McapFile> file(new McapFile(path));
  std::error_code error;
  file->size_ = fs::file_size(path, error);
  file->stream_.open(path, std::ios::binary);
  if (error || !file->stream_) return absl::NotFoundError(absl::StrCat(path.string(), ": cannot be opened"));
  const absl::StatusOr<std::string> magic = file->ReadBytes(0, std::min<uint64_t>(kMagic.size(), file->size_));
  if (!magic.ok() || *magic != kMagic)
    return absl::InvalidArgumentError(absl::StrCat(path.string(), ": is no MCAP file"));
  Parser parser{*file, visit};
  for (uint64_t at = kMagic.size();;) {
    const absl::StatusOr<std::string> head = file->ReadBytes(at, kRecordHead);
    if (!head.ok()) return head.status();
    MessageCursor cursor = CursorOf(*head);
    const auto opcode = cursor.Take<uint8_t>();
    const auto length = cursor.Take<uint64_t>();
    if (opcode == kFooter) break;
    const uint64_t begin = at + kRecordHead;
    if (length > file->size_ - begin) {
      return file->At(at, "the file ends early: the recording was broken off; `mcap recover` mends it");
    }
    if (opcode >= kSchema && opcode <= kChunk) {
      const absl::StatusOr<std::string> content = file->ReadBytes(begin, length);
      if (!content.ok()) return content.status();
      absl::Status taken =
          opcode == kChunk ? parser.TakeChunk(at, *content) : parser.Take(opcode, *content, at, kRecordHead, false);
      if (!taken.ok()) return taken;
    }
    at = begin + length;
  }
  return file;
}

absl::StatusOr<std::string> McapFile::Read(const McapMessage& message) const {
  const std::lock_guard lock(mutex_);
  if (!message.in_chunk) return ReadBytes(message.record + message.offset, message.bytes);
  if (held_ == nullptr || held_record_ != message.record) {
    held_ = nullptr;
    const absl::StatusOr<std::string> head = ReadBytes(message.record, kRecordHead);
    if (!head.ok()) return head.status();
    MessageCursor cursor = CursorOf(*head);
    cursor.Take<uint8_t>();
    const absl::StatusOr<std::string> content = ReadBytes(message.record + kRecordHead, cursor.Take<uint64_t>());
    if (!content.ok()) return content.status();
    absl::StatusOr<std::string> records = Unpack(message.record, *content);
    if (!records.ok()) return records.status();
    held_ = std::make_shared<const std::string>(*std::move(records));
    held_record_ = message.record;
  }
  if (message.offset + message.bytes > held_->size()) return At(message.record, "the file changed while it was read");
  return held_->substr(message.offset, message.bytes);
}

}  // namespace mapkeep
