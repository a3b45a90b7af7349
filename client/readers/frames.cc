#include "client/readers/frames.h"

#include <absl/strings/ascii.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>
#include <absl/strings/string_view.h>

#include <algorithm>
#include <vector>

namespace mapkeep {
namespace {

bool ParseCount(absl::string_view text, size_t* count) {
  uint32_t value = 0;
  if (!std::all_of(text.begin(), text.end(), absl::ascii_isdigit) || !absl::SimpleAtoi(text, &value)) return false;
  *count = value;
  return true;
}

}  // namespace

absl::StatusOr<FrameRange> ParseFrames(const std::string& text) {
  const std::vector<absl::string_view> parts = absl::StrSplit(text, ':');
  FrameRange range;
  const bool parsed = (parts.size() == 2 || parts.size() == 3) && ParseCount(parts[0], &range.first) &&
                      ParseCount(parts[1], &range.last) && (parts.size() == 2 || ParseCount(parts[2], &range.step));
  if (!parsed) {
    return absl::InvalidArgumentError(
        absl::StrCat("frames '", text, "': expected FIRST:LAST or FIRST:LAST:STEP, whole numbers from 0"));
  }
  if (range.last < range.first) {
    return absl::InvalidArgumentError(absl::StrCat("frames '", text, "': LAST is before FIRST"));
  }
  if (range.step == 0) return absl::InvalidArgumentError(absl::StrCat("frames '", text, "': STEP is 0"));
  return range;
}

absl::StatusOr<SessionDirectory> SelectFrames(const SessionDirectory& directory, const FrameRange& range) {
  if (range.last >= directory.files.size()) {
    return absl::InvalidArgumentError(absl::StrFormat("%s: frame %d is beyond the last one, %d",
                                                      directory.path.string(), range.last, directory.files.size() - 1));
  }
  SessionDirectory selected = directory;
  selected.files.clear();
  selected.poses.clear();
  selected.times.clear();
  for (size_t i = range.first; i <= range.last; i += range.step) {
    selected.files.push_back(directory.files[i]);
    selected.poses.push_back(directory.poses[i]);
    if (!directory.times.empty()) selected.times.push_back(directory.times[i]);
  }
  return selected;
}

}  // namespace mapkeep
