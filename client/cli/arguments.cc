#include "client/cli/arguments.h"

#include <absl/strings/ascii.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "client/cli/command_line.h"

namespace mapkeep {
namespace {

constexpr size_t kLongestName = 128;

bool IsNameCharacter(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '_' || c == ':' || c == '-';
}

absl::StatusOr<std::vector<double>> ParseNumbers(const std::string& option, const std::string& text, size_t count,
                                                 const char* expected) {
  std::vector<double> numbers;
  for (const absl::string_view word : absl::StrSplit(text, ',')) {
    double number = 0;
    if (absl::SimpleAtod(word, &number) && std::isfinite(number)) numbers.push_back(number);
  }
  const size_t words = static_cast<size_t>(std::count(text.begin(), text.end(), ',')) + 1;
  if (words != count || numbers.size() != count) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s '%s': expected %s, numbers in metres", option, text, expected));
  }
  return numbers;
}

}  // namespace

CLI::Validator NameValidator() {
  return CLI::Validator(
      [](std::string& name) -> std::string {
        const bool good = !name.empty() && name.size() <= kLongestName &&
                          absl::ascii_isalnum(static_cast<unsigned char>(name.front())) &&
                          std::all_of(name.begin(), name.end(), IsNameCharacter);
        return good ? "" : absl::StrFormat("'%s' is no name: expected [A-Za-z0-9][A-Za-z0-9._:-]{0,127}", name);
      },
      "");
}

absl::StatusOr<Eigen::Vector3d> ParsePoint(const std::string& option, const std::string& text) {
  absl::StatusOr<std::vector<double>> numbers = ParseNumbers(option, text, 3, "X,Y,Z");
  if (!numbers.ok()) return numbers.status();
  return Eigen::Vector3d(numbers->data());
}

absl::StatusOr<Eigen::AlignedBox3d> ParseBox(const std::string& option, const std::string& text) {
  absl::StatusOr<std::vector<double>> numbers = ParseNumbers(option, text, 6, "MINX,MINY,MINZ,MAXX,MAXY,MAXZ");
  if (!numbers.ok()) return numbers.status();
  const Eigen::AlignedBox3d box(Eigen::Vector3d(numbers->data()), Eigen::Vector3d(numbers->data() + 3));
  if (!(box.min().array() < box.max().array()).all()) {
    return absl::InvalidArgumentError(absl::StrFormat("%s '%s': every MIN must be below its MAX", option, text));
  }
  return box;
}

absl::StatusOr<KnownStart> ParseInitialPose(const std::string& option, const std::string& text) {
  const absl::StatusOr<std::vector<double>> numbers = ParseNumbers(option, text, 4, "X,Y,Z,YAW (degrees)");
  if (!numbers.ok()) return numbers.status();
  return KnownStart{(*numbers)[0], (*numbers)[1], (*numbers)[2], (*numbers)[3] * std::numbers::pi / 180};
}

absl::StatusOr<GnssStart> ParseGnss(const std::string& option, const std::string& text) {
  const absl::StatusOr<std::vector<double>> numbers = ParseNumbers(option, text, 5, "X,Y,Z,SIGMA_LEVEL,SIGMA_HEIGHT");
  if (!numbers.ok()) return numbers.status();
  if (!((*numbers)[3] > 0) || !((*numbers)[4] > 0)) {
    return absl::InvalidArgumentError(absl::StrFormat("%s '%s': expected deviations above 0 m", option, text));
  }
  return GnssStart{(*numbers)[0], (*numbers)[1], (*numbers)[2], (*numbers)[3], (*numbers)[4]};
}

std::string SessionIdFrom(const std::string& directory_name, uint32_t content_checksum) {
  const std::string suffix = absl::StrFormat("-%08x", content_checksum);
  std::string id;
  for (const char c : directory_name) {
    if (id.size() + suffix.size() == kLongestName) break;
    if (id.empty() && !absl::ascii_isalnum(static_cast<unsigned char>(c))) continue;
    id += IsNameCharacter(c) ? c : '-';
  }
  return (id.empty() ? "session" : id) + suffix;
}

}  // namespace mapkeep
