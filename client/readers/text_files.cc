#include "client/readers/text_files.h"

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>
#include <absl/strings/string_view.h>
#include <absl/strings/strip.h>

#include <cmath>
#include <fstream>
#include <span>
#include <string>

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

struct Line {
  size_t number = 0;  ///< from 1
  std::string text;
};

absl::Status AtLine(const fs::path& file, const Line& line, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrFormat("%s:%d: %s", file.string(), line.number, what));
}

/// The lines that carry something; an empty one in the middle is kept, so that it is seen to be a short row.
absl::StatusOr<std::vector<Line>> ReadLines(const fs::path& file) {
  std::ifstream stream(file);
  if (!stream) return absl::NotFoundError(absl::StrCat(file.string(), ": no such file"));
  std::vector<Line> lines;
  size_t number = 0;
  for (std::string text; std::getline(stream, text);) {
    ++number;
    const absl::string_view stripped = absl::StripAsciiWhitespace(text);
    if (!absl::StartsWith(stripped, "#")) lines.push_back({number, std::string(stripped)});
  }
  while (!lines.empty() && lines.back().text.empty()) lines.pop_back();
  return lines;
}

absl::StatusOr<std::vector<double>> ParseNumbers(const fs::path& file, const Line& line, absl::string_view text,
                                                 size_t expected) {
  const std::vector<absl::string_view> words = absl::StrSplit(text, absl::ByAnyChar(" \t,"), absl::SkipEmpty());
  if (words.size() != expected) {
    return AtLine(file, line, absl::StrFormat("%d numbers where %d are expected", words.size(), expected));
  }
  std::vector<double> numbers(expected);
  for (size_t i = 0; i < expected; ++i) {
    if (!absl::SimpleAtod(words[i], &numbers[i])) {
      return AtLine(file, line, absl::StrFormat("'%s' is not a number", words[i].substr(0, 40)));
    }
  }
  return numbers;
}

absl::StatusOr<Pose> ParsePose(const fs::path& file, const Line& line, absl::string_view text) {
  absl::StatusOr<std::vector<double>> numbers = ParseNumbers(file, line, text, 12);
  if (!numbers.ok()) return numbers.status();
  absl::StatusOr<Pose> pose = PoseFromRows(std::span<const double, 12>(*numbers));
  if (!pose.ok()) return AtLine(file, line, pose.status().message());
  return pose;
}

}  // namespace

absl::StatusOr<std::vector<Pose>> ReadPoses(const fs::path& file) {
  absl::StatusOr<std::vector<Line>> lines = ReadLines(file);
  if (!lines.ok()) return lines.status();
  std::vector<Pose> poses;
  poses.reserve(lines->size());
  for (const Line& line : *lines) {
    absl::StatusOr<Pose> pose = ParsePose(file, line, line.text);
    if (!pose.ok()) return pose.status();
    poses.push_back(*pose);
  }
  return poses;
}

absl::StatusOr<std::vector<double>> ReadTimes(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) return std::vector<double>();
  absl::StatusOr<std::vector<Line>> lines = ReadLines(file);
  if (!lines.ok()) return lines.status();
  std::vector<double> times;
  times.reserve(lines->size());
  for (const Line& line : *lines) {
    absl::StatusOr<std::vector<double>> numbers = ParseNumbers(file, line, line.text, 1);
    if (!numbers.ok()) return numbers.status();
    const double time = numbers->front();
    if (!std::isfinite(time) || time < 0) return AtLine(file, line, "not a time in seconds");
    times.push_back(time);
  }
  return times;
}

absl::StatusOr<std::vector<TimedPose>> ReadTimedPoses(const fs::path& file) {
  absl::StatusOr<std::vector<Line>> lines = ReadLines(file);
  if (!lines.ok()) return lines.status();
  std::vector<TimedPose> poses;
  poses.reserve(lines->size());
  for (const Line& line : *lines) {
    const std::vector<absl::string_view> words = absl::StrSplit(line.text, absl::ByAnyChar(" \t,"), absl::SkipEmpty());
    absl::StatusOr<std::vector<double>> numbers = ParseNumbers(file, line, line.text, words.size() == 8 ? 8 : 13);
    if (!numbers.ok()) return numbers.status();
    TimedPose timed{.time = numbers->front()};
    if (numbers->size() == 13) {
      const absl::StatusOr<Pose> pose = PoseFromRows(std::span<const double, 12>(numbers->data() + 1, 12));
      if (!pose.ok()) return AtLine(file, line, pose.status().message());
      timed.pose = *pose;
    } else {
      const std::vector<double>& v = *numbers;
      const Eigen::Quaterniond rotation(v[7], v[4], v[5], v[6]);
      constexpr double kNotUnit = 0.01;
      if (!(std::abs(rotation.norm() - 1) < kNotUnit) || !std::isfinite(v[1] + v[2] + v[3])) {
        return AtLine(file, line, "no pose: expected a time, x y z and a unit quaternion qx qy qz qw");
      }
      timed.pose.linear() = rotation.normalized().toRotationMatrix();
      timed.pose.translation() = Eigen::Vector3d(v[1], v[2], v[3]);
    }
    poses.push_back(timed);
  }
  return poses;
}

absl::StatusOr<std::optional<Pose>> ReadCalibration(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) return std::nullopt;
  absl::StatusOr<std::vector<Line>> lines = ReadLines(file);
  if (!lines.ok()) return lines.status();
  for (const Line& line : *lines) {
    absl::string_view text = line.text;
    if (!absl::ConsumePrefix(&text, "Tr:") && !absl::ConsumePrefix(&text, "Tr ")) continue;
    absl::StatusOr<Pose> pose = ParsePose(file, line, text);
    if (!pose.ok()) return pose.status();
    return *pose;
  }
  return std::nullopt;
}

}  // namespace mapkeep
