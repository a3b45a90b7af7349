#include "server/http/content_coding.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <map>
#include <optional>
#include <vector>

#include "storage/text.h"

namespace mapkeep {
namespace {

// Quality by name, as in "gzip;q=0.5, *".
std::map<std::string, double> Qualities(std::string_view field) {
  std::map<std::string, double> qualities;
  for (const absl::string_view part : absl::StrSplit(ToAbsl(field), ',')) {
    const std::vector<std::string> pieces = absl::StrSplit(part, ';');
    double quality = 1;
    for (size_t i = 1; i < pieces.size(); ++i) {
      const std::string parameter = absl::AsciiStrToLower(absl::StripAsciiWhitespace(pieces[i]));
      if (absl::StartsWith(parameter, "q=") && !absl::SimpleAtod(parameter.substr(2), &quality)) quality = 0;
    }
    qualities.emplace(absl::AsciiStrToLower(absl::StripAsciiWhitespace(pieces[0])), quality);
  }
  return qualities;
}

// "bytes=5-9", "bytes=5-", "bytes=-5" of a body; nothing for what is to be ignored; count 0 for what lies outside.
std::optional<std::pair<size_t, size_t>> PartOf(std::string_view range, size_t size) {
  constexpr std::string_view kUnit = "bytes=";
  if (!range.starts_with(kUnit)) return {};
  range.remove_prefix(kUnit.size());
  const size_t dash = range.find('-');
  if (dash == std::string_view::npos || range.find(',') != std::string_view::npos) return {};
  const auto number = [](std::string_view text) -> std::optional<size_t> {
    size_t value = 0;
    const bool digits = !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
    if (!digits || !absl::SimpleAtoi(std::string(text), &value)) return {};
    return value;
  };
  const std::string_view from = range.substr(0, dash), to = range.substr(dash + 1);
  const auto first = number(from), last = number(to);
  if (from.empty()) {
    if (!last) return {};
    const size_t count = std::min(*last, size);
    return std::pair{size - count, count};
  }
  if (!first || (!to.empty() && !last) || (last && *last < *first)) return {};
  if (*first >= size) return std::pair{size, size_t{0}};
  return std::pair{*first, std::min(last.value_or(size), size - 1) - *first + 1};
}

}  // namespace

std::string NameOf(Coding coding) { return coding == Coding::kZstd ? "zstd" : coding == Coding::kGzip ? "gzip" : ""; }

Coding BestCoding(std::string_view accept_encoding) {
  if (accept_encoding.empty()) return Coding::kIdentity;
  const std::map<std::string, double> qualities = Qualities(accept_encoding);
  const auto quality = [&qualities](const char* name) {
    const auto named = qualities.find(name), any = qualities.find("*");
    return named != qualities.end() ? named->second : any != qualities.end() ? any->second : 0.0;
  };
  const double zstd = quality("zstd"), gzip = quality("gzip");
  if (zstd > 0 && zstd >= gzip) return Coding::kZstd;
  return gzip > 0 ? Coding::kGzip : Coding::kIdentity;
}

std::string EntityTag(std::string_view name, Coding coding) {
  return Text("\"", name, coding == Coding::kIdentity ? "" : "-", NameOf(coding), "\"");
}

bool NamesTag(std::string_view field, std::string_view etag) {
  for (absl::string_view part : absl::StrSplit(ToAbsl(field), ',')) {
    part = absl::StripAsciiWhitespace(part);
    if (part == "*") return true;
    absl::ConsumePrefix(&part, "W/");
    if (FromAbsl(part) == etag) return true;
  }
  return false;
}

void ApplyRange(const PageRequest& request, PageResponse& page) {
  page.headers.emplace_back("Accept-Ranges", "bytes");
  if (request.range.empty() || page.status != 200) return;
  if (!request.if_range.empty() && request.if_range != page.etag) return;
  const size_t size = page.body->size();
  const auto part = PartOf(request.range, size);
  if (!part) return;
  if (part->second == 0) {
    page = ErrorPage(416, "OUT_OF_RANGE", absl::StrCat("Range: the body has ", size, " bytes"));
    page.headers.emplace_back("Content-Range", absl::StrCat("bytes */", size));
    return;
  }
  page.status = 206;
  page.part = *part;
  page.headers.emplace_back("Content-Range",
                            absl::StrCat("bytes ", part->first, "-", part->first + part->second - 1, "/", size));
}

}  // namespace mapkeep
