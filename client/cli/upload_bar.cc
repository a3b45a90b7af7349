#include "client/cli/upload_bar.h"

#include <absl/strings/str_format.h>

#include <cmath>

namespace mapkeep {
namespace {

constexpr double kWindow = 10;  // seconds
constexpr int kWidth = 24;

std::string Duration(double seconds) {
  const auto whole = static_cast<int64_t>(std::ceil(seconds));
  if (whole >= 3600) return absl::StrFormat("%d:%02d:%02d", whole / 3600, whole / 60 % 60, whole % 60);
  return absl::StrFormat("%d:%02d", whole / 60, whole % 60);
}

}  // namespace

std::string UploadBar::Line(const UploadProgress& progress, double now) {
  // What was durable before this began says nothing about the rate; nor does the time of a break.
  if (progress.is_broken) samples_.clear();
  samples_.push_back({now, progress.durable_scans, progress.durable_bytes});
  while (samples_.size() > 2 && samples_[1].time <= now - kWindow) samples_.pop_front();

  const double share = progress.scan_count == 0 ? 1 : static_cast<double>(progress.durable_scans) / progress.scan_count;
  const int filled = static_cast<int>(share * kWidth);
  std::string bar(filled, '=');
  if (filled < kWidth) bar += '>';
  bar.resize(kWidth, ' ');
  std::string line = absl::StrFormat("[%s] %d %%, %d of %d scans", bar, static_cast<int>(100 * share),
                                     progress.durable_scans, progress.scan_count);
  if (progress.is_broken) return line + ", waiting for the server";
  const Sample& oldest = samples_.front();
  const double seconds = now - oldest.time;
  const uint32_t scans = progress.durable_scans - oldest.scans;
  if (seconds <= 0 || scans == 0) return line;
  absl::StrAppendFormat(&line, ", %.1f MB/s",
                        1e-6 * static_cast<double>(progress.durable_bytes - oldest.bytes) / seconds);
  const uint32_t left = progress.scan_count - progress.durable_scans;
  return line + absl::StrFormat(", %s left", Duration(left * seconds / scans));
}

}  // namespace mapkeep
