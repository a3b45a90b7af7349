#include "server/auth/authority.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <sys/stat.h>

#include <fstream>
#include <sstream>
#include <utility>

namespace mapkeep {
namespace {

constexpr std::string_view kScheme = "Bearer ";

}  // namespace

Authority::Stamp Authority::StampOf(const std::string& file) {
  struct stat found {};
  if (stat(file.c_str(), &found) != 0) return {};
  return {found.st_ino, found.st_size, found.st_mtim.tv_sec, found.st_mtim.tv_nsec};
}

absl::StatusOr<std::shared_ptr<const TokenTable>> Authority::Read(const std::string& file) {
  std::ifstream in(file);
  std::ostringstream text;
  if (in) text << in.rdbuf();
  if (!in || in.bad()) return absl::UnavailableError(absl::StrCat(file, ": cannot be read"));
  auto table = TokenTable::Parse(text.str(), file);
  if (!table.ok()) return table.status();
  return std::make_shared<const TokenTable>(*std::move(table));
}

absl::StatusOr<std::unique_ptr<Authority>> Authority::Open(const std::string& file) {
  auto authority = std::make_unique<Authority>();
  authority->file_ = file;
  authority->stamp_ = StampOf(file);
  auto table = Read(file);
  if (!table.ok()) return table.status();
  authority->table_ = *std::move(table);
  return authority;
}

absl::StatusOr<bool> Authority::Reload() {
  if (file_.empty()) return false;
  const Stamp stamp = StampOf(file_);
  {
    const std::lock_guard lock(mutex_);
    if (stamp == stamp_) return false;
    stamp_ = stamp;
  }
  auto table = Read(file_);
  if (!table.ok()) return table.status();
  const std::lock_guard lock(mutex_);
  table_ = *std::move(table);
  return true;
}

bool Authority::has_tokens() const {
  const std::lock_guard lock(mutex_);
  return table_ != nullptr;
}

absl::StatusOr<Caller> Authority::Authenticate(std::string_view authorization) const {
  std::shared_ptr<const TokenTable> table;
  {
    const std::lock_guard lock(mutex_);
    table = table_;
  }
  if (table == nullptr) return Anybody();
  if (authorization.empty()) return absl::UnauthenticatedError("a token is needed: authorization: Bearer TOKEN");
  if (!absl::StartsWithIgnoreCase({authorization.data(), authorization.size()}, {kScheme.data(), kScheme.size()})) {
    return absl::UnauthenticatedError("authorization: expected Bearer TOKEN");
  }
  authorization.remove_prefix(kScheme.size());
  const absl::string_view token = absl::StripAsciiWhitespace({authorization.data(), authorization.size()});
  const Caller* caller = table->Find({token.data(), token.size()});
  if (caller == nullptr) return absl::UnauthenticatedError("the token is not known");
  return *caller;
}

absl::StatusOr<Caller> Authority::Authorize(std::string_view authorization, Access access, const Scope& scope) const {
  auto caller = Authenticate(authorization);
  if (!caller.ok()) return caller.status();
  if (absl::Status status = Allow(*caller, access, scope); !status.ok()) return status;
  return caller;
}

}  // namespace mapkeep
