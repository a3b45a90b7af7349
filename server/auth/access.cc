#include "server/auth/access.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>

namespace mapkeep {
namespace {

// Roles that will do, or-ed, and in words.
struct Need {
  uint8_t roles;
  const char* words;
};

constexpr uint8_t Bits(Role role) { return static_cast<uint8_t>(role); }

constexpr Need NeedOf(Access access) {
  switch (access) {
    case Access::kRead:
      return {Bits(Role::kReader) | Bits(Role::kOperator), "reader or operator"};
    case Access::kFollow:
      return {Bits(Role::kReader) | Bits(Role::kRobot) | Bits(Role::kOperator), "robot, reader or operator"};
    case Access::kUpload:
      return {Bits(Role::kRobot) | Bits(Role::kOperator), "robot or operator"};
    case Access::kOperate:
      break;
  }
  return {Bits(Role::kOperator), "operator"};
}

}  // namespace

bool Caller::Covers(std::string_view map) const {
  return std::ranges::any_of(maps, [map](std::string_view pattern) {
    if (pattern == "*") return true;
    if (!pattern.empty() && pattern.back() == '*') {
      pattern.remove_suffix(1);
      return map.starts_with(pattern) && map != "*";
    }
    return pattern == map;
  });
}

bool Caller::May(Access access, std::string_view map) const {
  return (roles & NeedOf(access).roles) != 0 && Covers(map);
}

bool Caller::Owns(Access access, std::string_view robot) const {
  if (Has(Role::kOperator)) return true;
  if (access == Access::kFollow && Has(Role::kReader)) return true;
  return Has(Role::kRobot) && robot == name;
}

Caller Anybody() { return {.roles = Bits(Role::kOperator), .maps = {"*"}}; }

absl::Status Allow(const Caller& caller, Access access, const Scope& scope) {
  const Need need = NeedOf(access);
  if ((caller.roles & need.roles) == 0) {
    return absl::PermissionDeniedError(absl::StrFormat("token %s: this needs the role %s", caller.name, need.words));
  }
  switch (scope.kind) {
    case Scope::Kind::kAny:
      return absl::OkStatus();
    case Scope::Kind::kAll:
      if (caller.CoversAll()) return absl::OkStatus();
      return absl::PermissionDeniedError(absl::StrFormat("token %s: this needs a token for every map", caller.name));
    case Scope::Kind::kMap:
      break;
  }
  if (caller.Covers(scope.map)) return absl::OkStatus();
  return absl::PermissionDeniedError(absl::StrFormat("token %s is not for map %s", caller.name, scope.map));
}

absl::Status AllowSession(const Caller& caller, Access access, std::string_view robot) {
  if (caller.Owns(access, robot)) return absl::OkStatus();
  return absl::PermissionDeniedError(
      absl::StrFormat("token %s: the session is that of %s", caller.name,
                      robot.empty() ? "no robot" : absl::StrCat("robot ", std::string(robot))));
}

}  // namespace mapkeep
