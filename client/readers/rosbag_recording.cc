// The only file that knows librosbag.
#include <absl/strings/str_cat.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <map>
#include <mutex>
#include <utility>

#include "client/readers/recording.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

/// Takes the bytes of a message as they lie in the bag.
class Bytes {
 public:
  explicit Bytes(size_t size) : bytes_(size, '\0'), stream_(reinterpret_cast<uint8_t*>(bytes_.data()), bytes_.size()) {}
  ros::serialization::OStream& stream() { return stream_; }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
  ros::serialization::OStream stream_;
};

class RosBags final : public Recording {
 public:
  absl::Status Open(const std::vector<fs::path>& files) {
    for (const fs::path& file : files) {
      files_ += (files_.empty() ? "" : ", ") + file.string();
      try {
        bags_.push_back(std::make_unique<rosbag::Bag>());
        bags_.back()->open(file.string(), rosbag::bagmode::Read);
        view_.addQuery(*bags_.back());
      } catch (const rosbag::BagUnindexedException&) {
        return absl::InvalidArgumentError(
            absl::StrCat(file.string(), ": has no index: the recording was broken off; `rosbag reindex` mends it"));
      } catch (const std::exception& error) {
        return absl::InvalidArgumentError(
            absl::StrCat(file.string(), ": is no ROS bag that can be read: ", error.what()));
      }
    }
    try {
      Index();
    } catch (const std::exception& error) {
      return absl::InvalidArgumentError(absl::StrCat(files_, ": cannot be read: ", error.what()));
    }
    return absl::OkStatus();
  }

  const std::vector<RecordedTopic>& topics() const override { return topics_; }

  absl::StatusOr<std::string> Read(size_t topic, uint64_t index) const override {
    const std::lock_guard lock(mutex_);
    try {
      const rosbag::MessageInstance& message = messages_[topic][index];
      Bytes bytes(message.size());
      message.write(bytes.stream());
      return bytes.Take();
    } catch (const std::exception& error) {
      return absl::InvalidArgumentError(absl::StrCat(files_, ": cannot be read: ", error.what()));
    }
  }

  double TimeOf(size_t topic, uint64_t index) const override { return messages_[topic][index].getTime().toSec(); }

 private:
  void Index() {
    std::map<std::pair<std::string, std::string>, size_t> known;
    for (const rosbag::MessageInstance& message : view_) {
      const auto [at, is_new] = known.try_emplace({message.getTopic(), message.getDataType()}, topics_.size());
      if (is_new) {
        topics_.push_back({.name = message.getTopic(),
                           .type = message.getDataType(),
                           .kind = KindOf(message.getDataType()),
                           .encoding = MessageEncoding::kRos1});
        messages_.emplace_back();
      }
      RecordedTopic& topic = topics_[at->second];
      ++topic.messages;
      if (topic.kind == MessageKind::kOther) continue;
      topic.bytes += message.size();
      messages_[at->second].push_back(message);
    }
  }

  std::string files_;
  std::vector<std::unique_ptr<rosbag::Bag>> bags_;
  rosbag::View view_;
  std::vector<RecordedTopic> topics_;
  std::vector<std::vector<rosbag::MessageInstance>> messages_;  ///< a topic
  mutable std::mutex mutex_;                                    ///< bags seek
};

}  // namespace

absl::StatusOr<std::unique_ptr<Recording>> OpenRosBags(const std::vector<fs::path>& files) {
  auto bags = std::make_unique<RosBags>();
  if (absl::Status status = bags->Open(files); !status.ok()) return status;
  return bags;
}

}  // namespace mapkeep
