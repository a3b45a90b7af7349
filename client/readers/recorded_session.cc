#include "client/readers/recorded_session.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <absl/strings/string_view.h>

#include <algorithm>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "client/readers/deskew.h"
#include "client/readers/pose_track.h"
#include "client/readers/scan_files.h"
#include "client/readers/transform_tree.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

std::string TopicList(const Recording& recording) {
  if (recording.topics().empty()) return "it holds no message";
  return absl::StrCat("it holds ",
                      absl::StrJoin(recording.topics(), ", ", [](std::string* out, const RecordedTopic& topic) {
                        absl::StrAppendFormat(out, "%s (%s, %d)", topic.name, topic.type, topic.messages);
                      }));
}

/// Makes a session of one recording.
class Maker {
 public:
  Maker(std::shared_ptr<const Recording> recording, const fs::path& path, const SessionOptions& options)
      : recording_(std::move(recording)), path_(path), options_(options) {}

  absl::StatusOr<SessionDirectory> Run() {
    const absl::StatusOr<size_t> points =
        FindTopic({MessageKind::kPointCloud}, options_.points_topic, "--points-topic");
    if (!points.ok()) return points.status();
    points_ = *points;
    if (absl::Status status = ReadStamps(); !status.ok()) return status;
    if (absl::Status status = ReadTransforms(); !status.ok()) return status;
    const auto track = MakeTrack();
    if (!track.ok()) return track.status();
    return MakeSession(std::make_shared<const PoseTrack>(*track));
  }

 private:
  const RecordedTopic& Topic(size_t topic) const { return recording_->topics()[topic]; }

  absl::Status Wrong(std::string_view what) const {
    return absl::InvalidArgumentError(absl::StrFormat("%s: %s", path_.string(), what));
  }
  absl::Status WrongMessage(size_t topic, uint64_t index, absl::string_view what) const {
    return Wrong(absl::StrFormat("topic %s, message %d: %s", Topic(topic).name, index, what));
  }

  /// The topic of one of these kinds that has the most messages, or the one that is named.
  absl::StatusOr<size_t> FindTopic(std::initializer_list<MessageKind> kinds, const std::string& name,
                                   std::string_view option) const {
    std::optional<size_t> best;
    for (size_t i = 0; i < recording_->topics().size(); ++i) {
      const RecordedTopic& topic = Topic(i);
      const bool fits = std::ranges::find(kinds, topic.kind) != kinds.end() && (name.empty() || topic.name == name);
      if (fits && (!best.has_value() || topic.messages > Topic(*best).messages)) best = i;
    }
    if (best.has_value()) return *best;
    return Wrong(name.empty() ? absl::StrFormat("has no topic of the type needed: %s", TopicList(*recording_))
                              : absl::StrFormat("%s %s: no topic of that name and a type that fits: %s", option, name,
                                                TopicList(*recording_)));
  }

  /// When each cloud was taken, and in which frame.
  absl::Status ReadStamps() {
    for (uint64_t i = 0; i < Topic(points_).messages; ++i) {
      const absl::StatusOr<std::string> message = recording_->Read(points_, i);
      if (!message.ok()) return message.status();
      const absl::StatusOr<CloudMessage> cloud = ReadCloudHeader(Topic(points_).encoding, *message);
      if (!cloud.ok()) return WrongMessage(points_, i, cloud.status().message());
      if (i > 0 && cloud->frame != frame_) {
        return WrongMessage(points_, i,
                            absl::StrFormat("its frame is '%s', that of the first is '%s'", cloud->frame, frame_));
      }
      frame_ = cloud->frame;
      stamps_.push_back(cloud->stamp != 0 ? cloud->stamp : recording_->TimeOf(points_, i));
    }
    return absl::OkStatus();
  }

  absl::Status ReadTransforms() {
    return ForEachPose({MessageKind::kTransforms}, {}, [this](size_t topic, const PoseMessage& transform) {
      tree_.Add(transform, Topic(topic).name.ends_with("tf_static"));
    });
  }

  /// Every pose message of these kinds, or of one topic.
  template <typename Visit>
  absl::Status ForEachPose(std::initializer_list<MessageKind> kinds, std::optional<size_t> only, const Visit& visit) {
    for (size_t topic = 0; topic < recording_->topics().size(); ++topic) {
      if (only.has_value() ? topic != *only : std::ranges::find(kinds, Topic(topic).kind) == kinds.end()) continue;
      for (uint64_t i = 0; i < Topic(topic).messages; ++i) {
        const absl::StatusOr<std::string> message = recording_->Read(topic, i);
        if (!message.ok()) return message.status();
        auto poses = ReadPoses(Topic(topic).kind, Topic(topic).encoding, *message);
        if (!poses.ok()) return WrongMessage(topic, i, poses.status().message());
        for (PoseMessage& pose : *poses) {
          if (pose.stamp == 0) pose.stamp = recording_->TimeOf(topic, i);
          visit(topic, pose);
        }
      }
    }
    tree_.Sort();
    return absl::OkStatus();
  }

  /// Of the sensor, in a frame that stands still.
  absl::StatusOr<PoseTrack> MakeTrack() {
    if (options_.poses_topic.empty() && options_.fixed_frame.empty()) {
      for (const MessageKind kind : {MessageKind::kOdometry, MessageKind::kPose}) {
        const absl::StatusOr<size_t> topic = FindTopic({kind}, "", "");
        if (topic.ok()) return TrackOfTopic(*topic);
      }
    } else if (!options_.poses_topic.empty()) {
      const absl::StatusOr<size_t> topic =
          FindTopic({MessageKind::kOdometry, MessageKind::kPose}, options_.poses_topic, "--poses-topic");
      if (!topic.ok()) return topic.status();
      return TrackOfTopic(*topic);
    }
    return TrackOfTransforms();
  }

  absl::StatusOr<PoseTrack> TrackOfTopic(size_t topic) {
    PoseTrack track;
    std::string child;
    if (absl::Status status = ForEachPose({}, topic,
                                          [&](size_t, const PoseMessage& pose) {
                                            child = pose.child;
                                            track.Add(pose.stamp, pose.pose);
                                          });
        !status.ok()) {
      return status;
    }
    const absl::StatusOr<Pose> sensor = SensorOn(child, topic);
    if (!sensor.ok()) return sensor.status();
    track.Sort();
    return track.Followed(*sensor);
  }

  /// Where the sensor is on what the poses are of.
  absl::StatusOr<Pose> SensorOn(const std::string& child, size_t topic) const {
    if (child == frame_ || options_.poses_are_of_sensor) return Pose::Identity();
    const std::optional<Pose> sensor = child.empty() ? std::nullopt : tree_.Fixed(child, frame_);
    if (sensor.has_value()) return *sensor;
    return Wrong(absl::StrFormat(
        "topic %s: its poses are of %s and the clouds' frame is '%s', with no static transform from one to the other: "
        "if they are one, say --poses-are-of-sensor",
        Topic(topic).name, child.empty() ? "an unnamed frame" : absl::StrCat("'", child, "'"), frame_));
  }

  absl::StatusOr<PoseTrack> TrackOfTransforms() const {
    const std::vector<std::string> chain = tree_.ChainOf(frame_);
    std::string fixed = options_.fixed_frame;
    for (const char* usual : {"odom", "map"}) {
      if (fixed.empty() && std::ranges::find(chain, usual) != chain.end()) fixed = usual;
    }
    if (fixed.empty()) fixed = chain.back();
    if (std::ranges::find(chain, fixed) == chain.end() || !tree_.Moves(fixed, frame_)) {
      return Wrong(absl::StrFormat(
          "nothing says where the sensor was: no Odometry or PoseStamped topic, and transforms lead from the clouds' "
          "frame '%s' only to %s; %s",
          frame_, absl::StrJoin(chain, ", "), TopicList(*recording_)));
    }
    // Where the clouds were taken, and often enough in between to follow the points of one.
    PoseTrack track;
    for (size_t i = 0; i < stamps_.size(); ++i) {
      const double step = i + 1 < stamps_.size() ? stamps_[i + 1] - stamps_[i] : 0;
      constexpr int kParts = 5;
      for (int part = 0; part < kParts; ++part) {
        const double time = stamps_[i] + step * part / kParts;
        const std::optional<Pose> pose = tree_.At(fixed, frame_, time);
        if (pose.has_value()) track.Add(time, *pose);
      }
    }
    track.Sort();
    return track;
  }

  absl::StatusOr<SessionDirectory> MakeSession(std::shared_ptr<const PoseTrack> track) const {
    SessionDirectory session;
    session.nan_is_no_return = true;
    session.bytes = Topic(points_).bytes;
    std::string folder = Topic(points_).name;
    folder.erase(0, folder.find_first_not_of('/'));
    for (size_t i = 0; i < stamps_.size(); ++i) {
      const std::optional<Pose> pose = track->At(stamps_[i]);
      if (!pose.has_value()) {
        if (track->empty() || stamps_[i] < track->first_time() || stamps_[i] > track->last_time()) continue;
        return WrongMessage(points_, i,
                            absl::StrFormat("there is no pose within a second of its time, %.3f s", stamps_[i]));
      }
      session.files.push_back(path_ / folder / absl::StrFormat("%06d", i));
      session.poses.push_back(*pose);
      session.times.push_back(stamps_[i]);
    }
    if (session.files.empty()) {
      return Wrong(absl::StrFormat("topic %s: none of its %d clouds was taken while there were poses",
                                   Topic(points_).name, stamps_.size()));
    }
    session.read_file = [recording = recording_, path = path_, points = points_, track, deskew = options_.deskew,
                         stamps = stamps_](const fs::path& file) -> absl::StatusOr<Scan> {
      uint64_t index = 0;
      if (!absl::SimpleAtoi(file.filename().string(), &index)) return absl::InternalError("a scan without a number");
      const RecordedTopic& topic = recording->topics()[points];
      const auto wrong = [&](absl::string_view what) {
        return absl::InvalidArgumentError(
            absl::StrFormat("%s: topic %s, message %d: %s", path.string(), topic.name, index, what));
      };
      const absl::StatusOr<std::string> message = recording->Read(points, index);
      if (!message.ok()) return message.status();
      absl::StatusOr<CloudMessage> cloud = ReadCloud(topic.encoding, *message);
      if (!cloud.ok()) return wrong(cloud.status().message());
      if (!deskew) return std::move(cloud->scan);
      if (cloud->offsets.empty()) return wrong("its points have no times: --deskew is not for it");
      absl::Status status = Deskew(*track, stamps[index], cloud->offsets, &cloud->scan);
      if (!status.ok()) return wrong(status.message());
      return std::move(cloud->scan);
    };
    return session;
  }

  const std::shared_ptr<const Recording> recording_;
  const fs::path path_;
  const SessionOptions options_;
  size_t points_ = 0;
  std::string frame_;
  std::vector<double> stamps_;  ///< one a cloud
  TransformTree tree_;
};

/// The file, or the files of a directory with the suffix.
absl::StatusOr<std::vector<fs::path>> FilesOf(const fs::path& path, std::string_view suffix) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return std::vector<fs::path>{path};
  return ListScanFiles(path, suffix);
}

}  // namespace

absl::StatusOr<SessionDirectory> SessionOf(std::shared_ptr<const Recording> recording, const fs::path& path,
                                           const SessionOptions& options) {
  return Maker(std::move(recording), path, options).Run();
}

absl::StatusOr<SessionDirectory> OpenRosBagSession(const fs::path& path, const SessionOptions& options) {
  const auto files = FilesOf(path, ".bag");
  if (!files.ok()) return files.status();
  auto recording = OpenRosBags(*files);
  if (!recording.ok()) return recording.status();
  return SessionOf(*std::move(recording), path, options);
}

absl::StatusOr<SessionDirectory> OpenMcapSession(const fs::path& path, const SessionOptions& options) {
  const auto files = FilesOf(path, ".mcap");
  if (!files.ok()) return files.status();
  auto recording = OpenMcapFiles(*files);
  if (!recording.ok()) return recording.status();
  return SessionOf(*std::move(recording), path, options);
}

}  // namespace mapkeep
