// Who gets in, over what, and what he may do.

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/dynamic_message.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "mapkeep/v1/admin_service.pb.h"
#include "mapkeep/v1/localization_service.pb.h"
#include "server/auth/token_table.h"
#include "server/rpc/call_rules.h"
#include "tests/integration/any_call.h"
#include "tests/integration/daemon_process.h"
#include "tests/integration/http_status.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using google::protobuf::MethodDescriptor;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// A daemon with one token a role for map "yard", tokens for everything, and others for map "depot".
class SecurityTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const std::string role : {"robot", "reader", "operator"}) {
      AddToken(role, role, "yard");
      AddToken(role + "-depot", role, "depot");
      AddToken(role + "-all", role, "*");
    }
    daemon_ = std::make_unique<DaemonProcess>(std::vector<std::string>{"--tokens", file()});
    channel_ = ChannelTo(daemon_->listen());
  }

  std::string file() const { return directory_.path() + "/tokens"; }

  void AddToken(const std::string& name, const std::string& role, const std::string& map) {
    std::ofstream(file(), std::ios::app) << *TokenLine(name, {role}, {map}, Secret(name)) << '\n';
  }
  static std::string Secret(const std::string& name) { return "secret-of-" + name; }

  // "yard" wherever the rule says that the map is named, and an id.
  static std::string RequestFor(const MethodDescriptor& method) {
    google::protobuf::DynamicMessageFactory factory;
    const std::unique_ptr<google::protobuf::Message> message(factory.GetPrototype(method.input_type())->New());
    google::protobuf::Message* at = message.get();
    std::string path(RuleOf(method.input_type())->map);
    if (path.empty()) return message->SerializeAsString();
    if (const size_t dot = path.find('.'); dot != std::string::npos) {
      at = at->GetReflection()->MutableMessage(at, at->GetDescriptor()->FindFieldByName(path.substr(0, dot)));
      path = path.substr(dot + 1);
    }
    at->GetReflection()->SetString(at, at->GetDescriptor()->FindFieldByName(path), "yard");
    if (const auto* id = at->GetDescriptor()->FindFieldByName("id")) at->GetReflection()->SetString(at, id, "s");
    return message->SerializeAsString();
  }

  grpc::StatusCode Code(const MethodDescriptor& method, const std::string& token,
                        std::chrono::seconds deadline = std::chrono::seconds(30)) const {
    const std::string path = "/" + method.service()->full_name() + "/" + method.name();
    return CallAny(channel_, path, RequestFor(method), token, "", deadline).status.error_code();
  }

  const TemporaryDirectory directory_;
  std::unique_ptr<DaemonProcess> daemon_;
  std::shared_ptr<grpc::Channel> channel_;
};

// The tokens that may use a method in map "yard".
std::vector<std::string> Holders(const CallRule& rule) {
  if (rule.scope == Scope::Kind::kAll) return {"operator-all"};
  std::vector<std::string> holders = {"operator", "operator-all"};
  if (rule.access == Access::kRead || rule.access == Access::kFollow)
    holders.insert(holders.end(), {"reader", "reader-all"});
  if (rule.access == Access::kUpload || rule.access == Access::kFollow)
    holders.insert(holders.end(), {"robot", "robot-all"});
  if (rule.scope == Scope::Kind::kAny) holders.insert(holders.end(), {"operator-depot", "reader-depot"});
  return holders;
}

TEST_F(SecurityTest, EveryMethodLetsInWhoseTokenIsForItAndNobodyElse) {
  const auto* file = v1::VerifyMapRequest::descriptor()->file();
  EXPECT_NE(v1::LocalizeRequest::descriptor()->file(), file);
  int methods = 0;
  for (const CallRule& rule : CallRules()) {
    const std::string name(rule.method);
    if (name == "MapService/DeleteMap" || name == "AdminService/CollectGarbage") continue;  // asked for below
    const auto* service = google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(
        "mapkeep.v1." + name.substr(0, name.find('/')));
    ASSERT_NE(service, nullptr) << name;
    const MethodDescriptor& method = *service->FindMethodByName(name.substr(name.find('/') + 1));
    ++methods;
    EXPECT_EQ(Code(method, ""), grpc::StatusCode::UNAUTHENTICATED) << name;
    EXPECT_EQ(Code(method, "secret-of-nobody"), grpc::StatusCode::UNAUTHENTICATED) << name;
    const std::vector<std::string> holders = Holders(rule);
    for (const std::string role : {"robot", "reader", "operator"}) {
      for (const std::string where : {"", "-depot", "-all"}) {
        const bool holds = std::ranges::find(holders, role + where) != holders.end();
        // Whoever may watch does so until the call's end; whoever may not is told, however long that takes.
        const bool watches = holds && name == "TileService/WatchMap";
        const grpc::StatusCode code = Code(method, Secret(role + where), std::chrono::seconds(watches ? 2 : 30));
        EXPECT_NE(code, grpc::StatusCode::UNAUTHENTICATED) << name;
        EXPECT_EQ(code != grpc::StatusCode::PERMISSION_DENIED, holds) << name << " with " << role << where;
      }
    }
  }
  EXPECT_GE(methods, 24);
  EXPECT_EQ(CallAny(channel_, "/mapkeep.v1.MapService/DeleteMap", "", Secret("reader")).status.error_code(),
            grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(CallAny(channel_, "/mapkeep.v1.AdminService/CollectGarbage", "", Secret("operator")).status.error_code(),
            grpc::StatusCode::PERMISSION_DENIED);
}

TEST_F(SecurityTest, ARefusedCallIsLoggedWithItsRequestIdAndWithoutTheSecret) {
  const AnyAnswer answer = CallAny(channel_, "/mapkeep.v1.MapService/ListMaps", "", "secret-of-nobody", "mine.42");
  EXPECT_EQ(answer.status.error_code(), grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(answer.trailers.at("x-request-id"), "mine.42");
  const AnyAnswer denied = CallAny(channel_, "/mapkeep.v1.MapService/CreateMap", "\x0a\x04yard", Secret("reader"));
  EXPECT_EQ(denied.status.error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(denied.trailers.at("x-request-id").size(), 16U) << "none was sent: one is made up";
  const AnyAnswer garbled = CallAny(channel_, "/mapkeep.v1.MapService/ListMaps", "", Secret("reader"), "a b=\"c");
  EXPECT_EQ(garbled.trailers.at("x-request-id").find(' '), std::string::npos);
  ASSERT_EQ(daemon_->End(SIGTERM), 0);
  EXPECT_THAT(daemon_->log(),
              AllOf(HasSubstr("call refused"), HasSubstr("request=mine.42"), HasSubstr("code=UNAUTHENTICATED"),
                    HasSubstr("method=/mapkeep.v1.MapService/CreateMap"), HasSubstr("token reader"),
                    HasSubstr("request=" + denied.trailers.at("x-request-id")), Not(HasSubstr("secret"))));
}

TEST_F(SecurityTest, EveryLineOfACallCarriesItsRequestAndSession) {
  ASSERT_THAT(CallAny(channel_, "/mapkeep.v1.MapService/CreateMap", "\x0a\x04yard", Secret("operator"), "r-1").status,
              IsOk());
  ASSERT_EQ(daemon_->End(SIGTERM), 0);
  EXPECT_THAT(daemon_->log(), ::testing::ContainsRegex("map created.*request=r-1 caller=operator"));
}

TEST_F(SecurityTest, ARobotUploadsUnderItsOwnNameAndCannotTouchAnothersSession) {
  ASSERT_THAT(CallAny(channel_, "/mapkeep.v1.MapService/CreateMap", "\x0a\x04yard", Secret("operator")).status, IsOk());
  AddToken("robot-2", "robot", "yard");
  const auto begin = [](const std::string& id, const std::string& robot) {
    v1::BeginSessionRequest request;
    request.set_map("yard");
    request.set_id(id);
    request.set_robot(robot);
    request.add_scan_crc32c(7);
    return request.SerializeAsString();
  };
  const std::string kBegin = "/mapkeep.v1.SessionService/BeginSession";
  EXPECT_THAT(CallAny(channel_, kBegin, begin("a", ""), Secret("robot")).status, IsOk());
  EXPECT_THAT(CallAny(channel_, kBegin, begin("b", "robot"), Secret("robot")).status, IsOk());
  EXPECT_THAT(CallAny(channel_, kBegin, begin("c", "robot-2"), Secret("robot")).status,
              FailsWith(grpc::StatusCode::PERMISSION_DENIED, {"robot-2"}));
  // The file was changed: the new token is good within seconds.
  grpc::Status second;
  for (int tries = 0; tries < 100; ++tries) {
    second = CallAny(channel_, kBegin, begin("a", ""), Secret("robot-2")).status;
    if (second.error_code() != grpc::StatusCode::UNAUTHENTICATED) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  EXPECT_THAT(second, FailsWith(grpc::StatusCode::PERMISSION_DENIED, {"robot robot"}));
  v1::GetSessionRequest get;
  get.set_map("yard");
  get.set_id("a");
  const std::string kGet = "/mapkeep.v1.SessionService/GetSession", bytes = get.SerializeAsString();
  EXPECT_THAT(CallAny(channel_, kGet, bytes, Secret("robot")).status, IsOk());
  EXPECT_THAT(CallAny(channel_, kGet, bytes, Secret("reader")).status, IsOk());
  EXPECT_THAT(CallAny(channel_, kGet, bytes, Secret("robot-2")).status,
              FailsWith(grpc::StatusCode::PERMISSION_DENIED, {"robot-2"}));
  v1::UploadScansRequest open;
  open.mutable_open()->set_map("yard");
  open.mutable_open()->set_id("a");
  EXPECT_THAT(
      CallAny(channel_, "/mapkeep.v1.SessionService/UploadScans", open.SerializeAsString(), Secret("robot-2")).status,
      FailsWith(grpc::StatusCode::PERMISSION_DENIED, {"robot-2"}));
}

TEST_F(SecurityTest, MapsThatATokenIsNotForAreNotListed) {
  for (const std::string map : {"yard", "depot"}) {
    v1::CreateMapRequest request;
    request.set_name(map);
    ASSERT_THAT(
        CallAny(channel_, "/mapkeep.v1.MapService/CreateMap", request.SerializeAsString(), Secret("operator-all"))
            .status,
        IsOk());
  }
  const auto stub = v1::MapService::NewStub(channel_);
  const auto list = [&](const std::string& token) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + Secret(token));
    v1::ListMapsResponse response;
    EXPECT_THAT(stub->ListMaps(&context, {}, &response), IsOk());
    std::string names;
    for (const v1::Map& map : response.maps()) names += map.name() + " ";
    return names;
  };
  EXPECT_EQ(list("reader"), "yard ");
  EXPECT_EQ(list("reader-depot"), "depot ");
  EXPECT_EQ(list("reader-all"), "depot yard ");
}

TEST_F(SecurityTest, ProbesNeedNoTokenAndMetricsDo) {
  EXPECT_EQ(HttpStatus(daemon_->admin(), "/livez"), 200);
  EXPECT_EQ(HttpStatus(daemon_->admin(), "/readyz"), 200);
  EXPECT_EQ(HttpStatus(daemon_->admin(), "/metrics"), 401);
  EXPECT_EQ(HttpGet(daemon_->admin(), "/metrics", Secret("reader")).status, 403) << "it tells of every map";
  const HttpAnswer metrics = HttpGet(daemon_->admin(), "/metrics", Secret("reader-all"));
  EXPECT_EQ(metrics.status, 200);
  EXPECT_THAT(metrics.body, HasSubstr("mapkeep_jobs_waiting 0"));
}

}  // namespace
}  // namespace mapkeep
