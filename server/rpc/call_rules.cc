#include "server/rpc/call_rules.h"

#include <absl/strings/str_cat.h>
#include <google/protobuf/message.h>

#include <string>
#include <unordered_map>

namespace mapkeep {
namespace {

using enum Access;
using enum Scope::Kind;

constexpr CallRule kRules[] = {
    {"AdminService/VerifyMap", kOperate, kMap, "map"},
    {"AdminService/CollectGarbage", kOperate, kAll, ""},
    // Whole stores, and directories of the daemon's machine.
    {"AdminService/Backup", kOperate, kAll, ""},
    {"AdminService/Restore", kOperate, kAll, ""},
    {"AdminService/ReplayMap", kOperate, kMap, "map"},
    {"LocalizationService/Localize", kRead, kMap, "open.map"},
    {"MapService/CreateMap", kOperate, kMap, "name"},
    {"MapService/GetMap", kRead, kMap, "name"},
    {"MapService/ListMaps", kRead, kAny, ""},
    {"MapService/DeleteMap", kOperate, kMap, "name"},
    {"MapService/QueryVoxel", kRead, kMap, "map"},
    {"MapService/ListVersions", kRead, kMap, "map"},
    {"MapService/AddTag", kOperate, kMap, "map"},
    {"MapService/RemoveTag", kOperate, kMap, "map"},
    {"MapService/RollBackMap", kOperate, kMap, "map"},
    {"MapService/CompareEpochs", kRead, kMap, "map"},
    {"MapService/ImportMap", kOperate, kMap, "header.name"},
    {"SessionService/BeginSession", kUpload, kMap, "map"},
    {"SessionService/UploadScans", kUpload, kMap, "open.map"},
    {"SessionService/CommitSession", kUpload, kMap, "map"},
    {"SessionService/GetSession", kFollow, kMap, "map"},
    {"SessionService/ListSessions", kRead, kMap, "map"},
    {"SessionService/WatchSession", kFollow, kMap, "map"},
    {"SessionService/RetrySession", kUpload, kMap, "map"},
    {"SessionService/DeleteSession", kOperate, kMap, "map"},
    {"SessionService/ListScanPoses", kFollow, kMap, "map"},
    {"TileService/GetTiles", kRead, kMap, "map"},
    {"TileService/ListTiles", kRead, kMap, "map"},
    {"TileService/StreamTiles", kRead, kMap, "map"},
    {"TileService/SyncTiles", kRead, kMap, "map"},
    {"TileService/WatchMap", kRead, kMap, "map"},
};

constexpr char kPackage[] = "mapkeep.v1.";

}  // namespace

std::span<const CallRule> CallRules() { return kRules; }

const CallRule* RuleOf(const google::protobuf::Descriptor* request) {
  // The protos name every request after its method.
  static const auto* const by_request = [] {
    auto* rules = new std::unordered_map<std::string, const CallRule*>;
    for (const CallRule& rule : kRules) {
      const std::string_view name = rule.method.substr(rule.method.find('/') + 1);
      rules->emplace(absl::StrCat(kPackage, std::string(name), "Request"), &rule);
    }
    return rules;
  }();
  const auto found = by_request->find(request->full_name());
  return found == by_request->end() ? nullptr : found->second;
}

}  // namespace mapkeep
