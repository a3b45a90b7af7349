#include "server/rpc/call_rules.h"

#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>

#include "mapkeep/v1/admin_service.pb.h"
#include "mapkeep/v1/localization_service.pb.h"
#include "mapkeep/v1/map_service.pb.h"
#include "mapkeep/v1/session_service.pb.h"
#include "mapkeep/v1/tile_service.pb.h"

namespace mapkeep {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::MethodDescriptor;

// Every method of every service in proto/, by its files: one that is added there is found here.
std::vector<const MethodDescriptor*> Methods() {
  // Names their files to the linker.
  for (const Descriptor* linked :
       {v1::VerifyMapRequest::descriptor(), v1::LocalizeRequest::descriptor(), v1::GetMapRequest::descriptor(),
        v1::GetSessionRequest::descriptor(), v1::StreamTilesRequest::descriptor()}) {
    EXPECT_NE(linked, nullptr);
  }
  std::vector<const MethodDescriptor*> methods;
  for (const auto& file : std::filesystem::directory_iterator(MAPKEEP_SOURCE_DIR "/proto/mapkeep/v1")) {
    const std::string name = "mapkeep/v1/" + file.path().filename().string();
    const auto* found = google::protobuf::DescriptorPool::generated_pool()->FindFileByName(name);
    EXPECT_TRUE(found != nullptr || name.find("_service") == std::string::npos) << name << ": name it above";
    if (found == nullptr) continue;
    for (int i = 0; i < found->service_count(); ++i) {
      for (int k = 0; k < found->service(i)->method_count(); ++k) methods.push_back(found->service(i)->method(k));
    }
  }
  return methods;
}

std::string NameOf(const MethodDescriptor& method) { return method.service()->name() + "/" + method.name(); }

TEST(CallRules, EveryMethodOfEveryServiceHasOne) {
  EXPECT_GE(Methods().size(), 26U);
  for (const MethodDescriptor* method : Methods()) {
    const CallRule* rule = RuleOf(method->input_type());
    ASSERT_NE(rule, nullptr) << NameOf(*method) << " has no line in server/rpc/call_rules.cc";
    EXPECT_EQ(rule->method, NameOf(*method));
  }
}

TEST(CallRules, NoneIsForAMethodThatIsNotThere) {
  std::set<std::string> methods;
  for (const MethodDescriptor* method : Methods()) methods.insert(NameOf(*method));
  for (const CallRule& rule : CallRules()) EXPECT_TRUE(methods.contains(std::string(rule.method))) << rule.method;
}

TEST(CallRules, EachNamesAFieldOfTextThatSaysWhichMap) {
  for (const MethodDescriptor* method : Methods()) {
    const CallRule& rule = *RuleOf(method->input_type());
    if (rule.scope != Scope::Kind::kMap) {
      EXPECT_EQ(rule.map, "") << rule.method;
      continue;
    }
    const Descriptor* message = method->input_type();
    std::string path(rule.map);
    if (const size_t dot = path.find('.'); dot != std::string::npos) {
      EXPECT_TRUE(method->client_streaming()) << rule.method << " opens no stream";
      const auto* opening = message->FindFieldByName(path.substr(0, dot));
      ASSERT_NE(opening, nullptr) << rule.method;
      message = opening->message_type();
      path = path.substr(dot + 1);
    } else {
      EXPECT_FALSE(method->client_streaming()) << rule.method << " opens with a message of its own";
    }
    const auto* field = message->FindFieldByName(path);
    ASSERT_NE(field, nullptr) << rule.method;
    EXPECT_EQ(field->type(), google::protobuf::FieldDescriptor::TYPE_STRING) << rule.method;
  }
}

}  // namespace
}  // namespace mapkeep
