#include "server/auth/token_table.h"

#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/rand.h>

#include <algorithm>
#include <set>
#include <utility>

#include "server/names.h"

namespace mapkeep {
namespace {

constexpr std::string_view kHashName = "sha256:";
constexpr size_t kRandomBytes = 32;

absl::StatusOr<uint8_t> RolesOf(std::string_view text) {
  uint8_t roles = 0;
  for (const std::string& word :
       std::vector<std::string>(absl::StrSplit(absl::string_view(text.data(), text.size()), ','))) {
    Role role{};
    if (word == "robot") {
      role = Role::kRobot;
    } else if (word == "reader") {
      role = Role::kReader;
    } else if (word == "operator") {
      role = Role::kOperator;
    } else {
      return absl::InvalidArgumentError(
          absl::StrFormat("role \"%s\": expected robot, reader or operator", absl::CHexEscape(word.substr(0, 64))));
    }
    roles |= static_cast<uint8_t>(role);
  }
  return roles;
}

absl::Status CheckMapPattern(std::string_view pattern) {
  if (pattern == "*") return absl::OkStatus();
  if (!pattern.empty() && pattern.back() == '*') pattern.remove_suffix(1);
  return CheckName("map", pattern);
}

absl::StatusOr<std::vector<std::string>> MapsOf(std::string_view text) {
  std::vector<std::string> maps = absl::StrSplit(absl::string_view(text.data(), text.size()), ',');
  for (const std::string& pattern : maps) {
    if (absl::Status status = CheckMapPattern(pattern); !status.ok()) return status;
  }
  return maps;
}

}  // namespace

TokenTable::Digest TokenTable::DigestOf(std::string_view token) {
  Digest digest{};
  unsigned length = 0;
  EVP_Digest(token.data(), token.size(), digest.data(), &length, EVP_sha256(), nullptr);
  return digest;
}

absl::StatusOr<TokenTable::Entry> TokenTable::ParseLine(std::string_view line) {
  const std::vector<std::string> words =
      absl::StrSplit(absl::string_view(line.data(), line.size()), absl::ByAnyChar(" \t"), absl::SkipEmpty());
  if (words.size() != 4) {
    return absl::InvalidArgumentError(absl::StrFormat("%d words, expected four: NAME ROLES MAPS HASH", words.size()));
  }
  Entry entry;
  if (absl::Status status = CheckName("name", words[0]); !status.ok()) return status;
  entry.caller.name = words[0];
  const auto roles = RolesOf(words[1]);
  if (!roles.ok()) return roles.status();
  entry.caller.roles = *roles;
  auto maps = MapsOf(words[2]);
  if (!maps.ok()) return maps.status();
  entry.caller.maps = *std::move(maps);
  const std::string_view hash = words[3];
  const std::string_view digits = hash.starts_with(kHashName) ? hash.substr(kHashName.size()) : std::string_view();
  if (digits.size() != 2 * entry.digest.size() || !std::ranges::all_of(digits, absl::ascii_isxdigit)) {
    // Not shown: somebody may have put the token itself there.
    return absl::InvalidArgumentError("the last word: expected sha256: and 64 hex digits");
  }
  const std::string bytes = absl::HexStringToBytes(absl::string_view(digits.data(), digits.size()));
  std::ranges::copy(bytes, entry.digest.begin());
  return entry;
}

absl::StatusOr<TokenTable> TokenTable::Parse(std::string_view text, std::string_view file) {
  TokenTable table;
  std::set<Digest> known;
  int number = 0;
  for (const absl::string_view raw : absl::StrSplit(absl::string_view(text.data(), text.size()), '\n')) {
    ++number;
    const absl::string_view line = absl::StripAsciiWhitespace(raw);
    if (line.empty() || line.front() == '#') continue;
    auto entry = ParseLine({line.data(), line.size()});
    absl::Status status = entry.status();
    if (status.ok() && !known.insert(entry->digest).second) {
      status = absl::InvalidArgumentError("another line has the same hash");
    }
    if (!status.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(std::string(file), ":", number, ": ", std::string(status.message())));
    }
    table.entries_.push_back(*std::move(entry));
  }
  return table;
}

const Caller* TokenTable::Find(std::string_view token) const {
  const Digest digest = DigestOf(token);
  const Caller* found = nullptr;
  for (const Entry& entry : entries_) {
    if (CRYPTO_memcmp(entry.digest.data(), digest.data(), digest.size()) == 0) found = &entry.caller;
  }
  return found;
}

absl::StatusOr<std::string> NewToken() {
  std::array<uint8_t, kRandomBytes> random{};
  if (RAND_bytes(random.data(), random.size()) != 1) return absl::UnavailableError("no randomness for a token");
  const std::string text = absl::WebSafeBase64Escape({reinterpret_cast<const char*>(random.data()), random.size()});
  return absl::StrCat("mk_", text);
}

absl::StatusOr<std::string> TokenLine(std::string_view name, const std::vector<std::string>& roles,
                                      const std::vector<std::string>& maps, std::string_view token) {
  if (absl::Status status = CheckName("name", name); !status.ok()) return status;
  if (roles.empty() || maps.empty()) return absl::InvalidArgumentError("expected at least one role and one map");
  const std::string of_roles = absl::StrJoin(roles, ","), of_maps = absl::StrJoin(maps, ",");
  if (absl::Status status = RolesOf(of_roles).status(); !status.ok()) return status;
  if (absl::Status status = MapsOf(of_maps).status(); !status.ok()) return status;
  std::array<uint8_t, 32> digest{};
  unsigned length = 0;
  EVP_Digest(token.data(), token.size(), digest.data(), &length, EVP_sha256(), nullptr);
  const std::string hex = absl::BytesToHexString({reinterpret_cast<const char*>(digest.data()), digest.size()});
  return absl::StrCat(std::string(name), " ", of_roles, " ", of_maps, " ", std::string(kHashName), hex);
}

}  // namespace mapkeep
