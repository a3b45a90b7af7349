#pragma once

#include <string>

namespace mapkeep {

/// How far a long command is. On a terminal one line that changes in place; otherwise a line when a stage begins.
/// Nothing at all for a program that reads JSON.
class ProgressLine {
 public:
  explicit ProgressLine(bool json);
  ~ProgressLine() { Clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// The stage at work and its share done, [0, 1].
  void Show(const std::string& stage, double fraction);

  /// The stage at work, and how far it is in words, for the terminal alone.
  void ShowText(const std::string& stage, const std::string& text);

  /// Leaves the terminal's line empty, for what is printed next.
  void Clear();

 private:
  enum class Style { kSilent, kTerminal, kLines };
  Style style_;
  std::string stage_;
  int percent_ = -1;
  std::string text_;
};

}  // namespace mapkeep
