#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace mapkeep {

/// What a token is good for. A token may have several roles.
enum class Role : uint8_t {
  kRobot = 1,     ///< uploads sessions under its own name and follows them
  kReader = 2,    ///< reads maps, tiles, sessions; localises
  kOperator = 4,  ///< everything
};

/// What a call needs.
enum class Access : uint8_t {
  kRead,     ///< a map and what is in it: reader, operator
  kFollow,   ///< one session: reader, operator, and the robot whose it is
  kUpload,   ///< to upload a session: the robot whose it is, operator
  kOperate,  ///< to change a map's history, or the store: operator
};

/// Somebody who calls: a token's line, or anybody where the daemon has no tokens. Holds no secret.
struct Caller {
  std::string name;               ///< the token's; empty: anybody
  uint8_t roles = 0;              ///< Role, or-ed
  std::vector<std::string> maps;  ///< names, or beginnings of names with a '*' at the end

  bool Has(Role role) const { return (roles & static_cast<uint8_t>(role)) != 0; }

  /// Whether the token is for that map.
  bool Covers(std::string_view map) const;
  /// Whether the token is for every map, those to come included.
  bool CoversAll() const { return Covers("*"); }
  /// May do this in this map; of kFollow and kUpload only with sessions that it Owns.
  bool May(Access access, std::string_view map) const;
  /// Robots may follow and upload only sessions that they began: those whose robot is the token's name. Readers may
  /// follow any, operators do everything. False says nothing about the map: see May.
  bool Owns(Access access, std::string_view robot) const;
};

/// Everything, everywhere: who calls a daemon without tokens.
Caller Anybody();

/// What a call is about, beside its access.
struct Scope {
  enum class Kind : uint8_t {
    kMap,  ///< `map`
    kAny,  ///< whatever the token is for: the answer holds what Caller::May lets through, and no more
    kAll,  ///< every map
  };
  Kind kind = Kind::kMap;
  std::string_view map;

  static Scope Map(std::string_view map) { return {Kind::kMap, map}; }
  static Scope Any() { return {Kind::kAny, {}}; }
  static Scope All() { return {Kind::kAll, {}}; }
};

/// PERMISSION_DENIED, naming the token, the roles that would do and the map.
absl::Status Allow(const Caller& caller, Access access, const Scope& scope);

/// Likewise for a session of `robot`, once that is known. PERMISSION_DENIED naming both.
absl::Status AllowSession(const Caller& caller, Access access, std::string_view robot);

}  // namespace mapkeep
