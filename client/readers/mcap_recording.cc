#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

#include "client/readers/mcap_file.h"
#include "client/readers/recording.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

MessageEncoding EncodingNamed(std::string_view name) {
  if (name == "cdr") return MessageEncoding::kCdr;
  if (name == "ros1") return MessageEncoding::kRos1;
  return MessageEncoding::kOther;
}

class McapRecording final : public Recording {
 public:
  absl::Status Open(const std::vector<fs::path>& paths) {
    for (const fs::path& path : paths) {
      auto file = McapFile::Open(
          path, [this](const McapChannel& channel, const McapMessage& message) { Note(channel, message); });
      if (!file.ok()) return file.status();
      files_.push_back(*std::move(file));
    }
    for (std::vector<Entry>& entries : messages_) {
      std::ranges::stable_sort(entries, {}, [](const Entry& entry) { return entry.message.log_time; });
    }
    return absl::OkStatus();
  }

  const std::vector<RecordedTopic>& topics() const override { return topics_; }

  absl::StatusOr<std::string> Read(size_t topic, uint64_t index) const override {
    const Entry& entry = messages_[topic][index];
    return files_[entry.file]->Read(entry.message);
  }

  double TimeOf(size_t topic, uint64_t index) const override {
    return 1e-9 * static_cast<double>(messages_[topic][index].message.log_time);
  }

 private:
  struct Entry {
    size_t file = 0;
    McapMessage message;
  };

  void Note(const McapChannel& channel, const McapMessage& message) {
    const auto [at, is_new] = known_.try_emplace({channel.topic, channel.schema, channel.encoding}, topics_.size());
    if (is_new) {
      RecordedTopic topic{.name = channel.topic,
                          .type = channel.schema,
                          .kind = KindOf(channel.schema),
                          .encoding = EncodingNamed(channel.encoding)};
      if (topic.encoding == MessageEncoding::kOther) topic.kind = MessageKind::kOther;
      topics_.push_back(std::move(topic));
      messages_.emplace_back();
    }
    RecordedTopic& topic = topics_[at->second];
    ++topic.messages;
    if (topic.kind == MessageKind::kOther) return;
    topic.bytes += message.bytes;
    messages_[at->second].push_back({files_.size(), message});
  }

  std::vector<std::unique_ptr<McapFile>> files_;
  std::vector<RecordedTopic> topics_;
  std::map<std::tuple<std::string, std::string, std::string>, size_t> known_;
  std::vector<std::vector<Entry>> messages_;  ///< a topic
};

}  // namespace

absl::StatusOr<std::unique_ptr<Recording>> OpenMcapFiles(const std::vector<fs::path>& files) {
  auto recording = std::make_unique<McapRecording>();
  if (absl::Status status = recording->Open(files); !status.ok()) return status;
  return recording;
}

}  // namespace mapkeep
