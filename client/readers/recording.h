#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "client/readers/message_cursor.h"
#include "client/readers/ros_messages.h"

namespace mapkeep {

/// One topic of a recording.
struct RecordedTopic {
  std::string name;
  std::string type;
  MessageKind kind = MessageKind::kOther;
  MessageEncoding encoding = MessageEncoding::kOther;
  uint64_t messages = 0;
  uint64_t bytes = 0;  ///< of its messages; of topics that are not kOther
};

/// Messages on topics over time: a ROS 1 bag or an MCAP file, or several that go on from one another. Only the messages
/// of the kinds that we know can be read.
class Recording {
 public:
  virtual ~Recording() = default;

  virtual const std::vector<RecordedTopic>& topics() const = 0;

  /// Message `index` of a topic, in order of the time when it was recorded. Thread-safe. Errors name the file.
  virtual absl::StatusOr<std::string> Read(size_t topic, uint64_t index) const = 0;

  /// When it was recorded, seconds since 1970.
  virtual double TimeOf(size_t topic, uint64_t index) const = 0;
};

/// ROS 1 bags, by librosbag. INVALID_ARGUMENT naming the file that is none, or was never closed.
absl::StatusOr<std::unique_ptr<Recording>> OpenRosBags(const std::vector<std::filesystem::path>& files);

/// MCAP files, with chunks compressed by zstd or LZ4, or none; the whole file is read and checked. Messages in CDR (ROS
/// 2) or ROS 1's serialisation. INVALID_ARGUMENT naming the file and the byte.
absl::StatusOr<std::unique_ptr<Recording>> OpenMcapFiles(const std::vector<std::filesystem::path>& files);

/// Whether the file begins as a ROS 1 bag, or as an MCAP file.
bool IsRosBag(const std::filesystem::path& file);
bool IsMcap(const std::filesystem::path& file);

}  // namespace mapkeep
