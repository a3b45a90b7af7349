#include "client/cli/progress_line.h"

#include <absl/strings/str_format.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>

namespace mapkeep {

ProgressLine::ProgressLine(bool json)
    : style_(json ? Style::kSilent : (isatty(STDERR_FILENO) != 0 ? Style::kTerminal : Style::kLines)) {}

void ProgressLine::Show(const std::string& stage, double fraction) {
  const int percent = static_cast<int>(100 * std::clamp(fraction, 0.0, 1.0));
  if (stage == stage_ && percent == percent_) return;
  const bool begins = stage != stage_;
  stage_ = stage;
  percent_ = percent;
  if (style_ == Style::kTerminal) {
    std::cerr << absl::StrFormat("\r\033[K%s %d %%", stage, percent) << std::flush;
  } else if (style_ == Style::kLines && begins) {
    std::cout << stage << std::endl;
  }
}

void ProgressLine::ShowText(const std::string& stage, const std::string& text) {
  if (stage == stage_ && text == text_) return;
  const bool begins = stage != stage_;
  stage_ = stage;
  text_ = text;
  if (style_ == Style::kTerminal) {
    std::cerr << absl::StrFormat("\r\033[K%s %s", stage, text) << std::flush;
  } else if (style_ == Style::kLines && begins) {
    std::cout << stage << std::endl;
  }
}

void ProgressLine::Clear() {
  if (style_ == Style::kTerminal && !stage_.empty()) std::cerr << "\r\033[K" << std::flush;
  stage_.clear();
  percent_ = -1;
  text_.clear();
}

}  // namespace mapkeep
