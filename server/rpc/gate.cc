#include "server/rpc/gate.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <random>

#include "server/rpc/call_rules.h"

namespace mapkeep {
namespace {

constexpr char kRequestId[] = "x-request-id";
constexpr size_t kLongestRequestId = 64;

std::string_view HeaderOf(const grpc::CallbackServerContext& context, const char* name) {
  const auto& headers = context.client_metadata();
  const auto found = headers.find(name);
  return found == headers.end() ? std::string_view() : std::string_view(found->second.data(), found->second.size());
}

// Only what does not garble a log line is taken over.
std::string RequestIdOf(const grpc::CallbackServerContext& context) {
  const std::string_view given = HeaderOf(context, kRequestId);
  const auto is_plain = [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == '.' || c == ':';
  };
  if (!given.empty() && given.size() <= kLongestRequestId && std::ranges::all_of(given, is_plain)) {
    return std::string(given);
  }
  thread_local std::mt19937_64 random(std::random_device{}());
  return absl::StrFormat("%016x", random());
}

// A field of text, "open.map" inside of a message; empty if it is not set or not there.
std::string TextAt(const google::protobuf::Message& message, std::string_view path) {
  const size_t dot = path.find('.');
  const auto* field = message.GetDescriptor()->FindFieldByName(std::string(path.substr(0, dot)));
  if (field == nullptr || field->is_repeated()) return "";
  const auto* reflection = message.GetReflection();
  if (dot == std::string_view::npos) {
    return field->cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_STRING
               ? reflection->GetString(message, field)
               : "";
  }
  if (field->cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE ||
      !reflection->HasField(message, field)) {
    return "";
  }
  return TextAt(reflection->GetMessage(message, field), path.substr(dot + 1));
}

// "open.map" -> "open.id".
std::string SessionPath(std::string_view map_path) {
  const size_t dot = map_path.rfind('.');
  return absl::StrCat(std::string(dot == std::string_view::npos ? "" : map_path.substr(0, dot + 1)), "id");
}

}  // namespace

LogTags Call::tags() const {
  LogTags tags = {{"request", request_id}};
  if (!caller.name.empty()) tags.emplace_back("caller", caller.name);
  if (!map.empty()) tags.emplace_back("map", map);
  if (!session.empty()) tags.emplace_back("session", session);
  return tags;
}

absl::StatusOr<Call> Gate::Admit(grpc::CallbackServerContext& context, const google::protobuf::Message& request) const {
  Call call{.request_id = RequestIdOf(context)};
  context.AddTrailingMetadata(kRequestId, call.request_id);
  const CallRule* rule = RuleOf(request.GetDescriptor());
  if (rule == nullptr) {
    return absl::PermissionDeniedError(absl::StrCat("there is no rule for ", request.GetDescriptor()->full_name()));
  }
  auto caller = authority_.Authenticate(HeaderOf(context, "authorization"));
  if (!caller.ok()) return caller.status();
  call.caller = *std::move(caller);
  const bool opens_later = rule->map.find('.') != std::string_view::npos;
  if (rule->scope != Scope::Kind::kMap || opens_later) {
    const Scope scope{opens_later ? Scope::Kind::kAny : rule->scope, {}};
    if (absl::Status status = Allow(call.caller, rule->access, scope); !status.ok()) return status;
    return call;
  }
  if (absl::Status status = Enter(call, request); !status.ok()) return status;
  return call;
}

absl::Status Gate::Enter(Call& call, const google::protobuf::Message& request) {
  const CallRule* rule = RuleOf(request.GetDescriptor());
  if (rule == nullptr) return absl::PermissionDeniedError("there is no rule for this");
  call.map = TextAt(request, rule->map);
  call.session = TextAt(request, SessionPath(rule->map));
  return Allow(call.caller, rule->access, Scope::Map(call.map));
}

}  // namespace mapkeep
