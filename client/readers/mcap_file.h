#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace mapkeep {

// MCAP (https://mcap.dev/spec), as much of it as a reader of everything needs:
//
//     file    := magic, record*, magic
//     record  := u8 opcode, u64 length, u8 content[length]
//     content := 02 footer: the data end here
//                03 schema: u16 id, string name, ...
//                04 channel: u16 id, u16 schema, string topic, string message_encoding, ...
//                05 message: u16 channel, u32 sequence, u64 log_time, u64 publish_time, bytes
//                06 chunk: u64 first, u64 last, u64 size, u32 crc, string compression, u64 n, u8 records[n]
//                others are indexes, attachments and statistics, and are passed over
//     string  := u32 n, u8[n]

/// A channel of messages.
struct McapChannel {
  std::string topic, schema, encoding;
};

/// Where a message lies.
struct McapMessage {
  uint16_t channel = 0;
  uint64_t log_time = 0;  ///< nanoseconds since 1970
  uint64_t record = 0;    ///< byte of the file where the chunk that holds it begins, or itself
  uint64_t offset = 0;    ///< in the chunk's records
  uint64_t bytes = 0;     ///< of the message alone
  bool in_chunk = false;
};

/// One file, read from its beginning to its end once, then at random. Every error is INVALID_ARGUMENT or NOT_FOUND and
/// begins with the file.
class McapFile {
 public:
  /// Told of each message, in the order of the file, after its channel; the bytes live until it returns.
  using Visit = std::function<void(const McapChannel& channel, const McapMessage& message)>;

  static absl::StatusOr<std::unique_ptr<McapFile>> Open(const std::filesystem::path& path, const Visit& visit);

  /// Thread-safe.
  absl::StatusOr<std::string> Read(const McapMessage& message) const;

 private:
  struct Parser;
  explicit McapFile(std::filesystem::path path) : path_(std::move(path)) {}

  absl::Status At(uint64_t byte, absl::string_view what) const;
  absl::StatusOr<std::string> ReadBytes(uint64_t offset, uint64_t count) const;
  absl::StatusOr<std::string> Unpack(uint64_t record, std::string_view content) const;

  std::filesystem::path path_;
  uint64_t size_ = 0;
  mutable std::mutex mutex_;
  mutable std::ifstream stream_;
  /// The chunk that was read last: messages come in order.
  mutable uint64_t held_record_ = 0;
  mutable std::shared_ptr<const std::string> held_;
};

}  // namespace mapkeep
