#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "storage/session_store.h"

namespace mapkeep {

// The session store's rows as values, with their encodings. Decoding damaged bytes is DATA_LOSS.

/// A session as its row has it. The row leaves out the map (whose partition it is in) and the content.
struct StoredSession {
  SessionRecord record;
  uint64_t incarnation = 0;  ///< random; names the group of the session's values
  uint32_t scan_count = 0;
  uint64_t poses = 0;  ///< names the values of the aligned poses; 0: none
  uint32_t pose_count = 0;
  uint64_t revision = 0;  ///< counts the changes, so that no two states of a session are equal bytes
};

/// Values of a deleted session that are to go.
struct SessionCleanup {
  uint64_t incarnation = 0;
  bool scans_only = false;  ///< otherwise the poses go, too
  uint32_t scan_count = 0;
};

std::string EncodeSession(const StoredSession& session);
std::string EncodeContent(std::span<const uint32_t> scan_crc32c);
std::string EncodeCleanup(const SessionCleanup& cleanup);
std::string EncodePoses(std::span<const Pose> poses);

absl::StatusOr<StoredSession> DecodeSession(std::string_view row);
absl::StatusOr<std::vector<uint32_t>> DecodeContent(std::string_view row);
absl::StatusOr<SessionCleanup> DecodeCleanup(std::string_view row);
absl::StatusOr<std::vector<Pose>> DecodePoses(std::string_view value);

}  // namespace mapkeep
