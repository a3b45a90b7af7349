#pragma once

#include <google/protobuf/descriptor.h>

#include <cstdint>
#include <span>
#include <string_view>

#include "server/auth/access.h"

namespace mapkeep {

/// What a call needs, and where its request says which map it is about.
struct CallRule {
  std::string_view method;  ///< "SessionService/BeginSession"
  Access access;
  Scope::Kind scope;
  std::string_view map;  ///< of kMap: the field that names the map, "open.map" or "header.name" inside the message that opens a stream
};

/// The one table: every method of every service, and nothing else may be called (a test asks the protos for both).
std::span<const CallRule> CallRules();

/// The rule of the method that takes such a request; nullptr if there is none. No two methods share one.
const CallRule* RuleOf(const google::protobuf::Descriptor* request);

}  // namespace mapkeep
