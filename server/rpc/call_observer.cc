#include "server/rpc/call_observer.h"

#include <absl/status/status.h>
#include <grpcpp/server_context.h>

#include <chrono>
#include <mutex>
#include <string>

#include "server/log.h"

namespace mapkeep {
namespace {

using grpc::experimental::InterceptionHookPoints;
using std::chrono::steady_clock;

constexpr int kLinesASecond = 100;

// Lets so many lines a second through, and counts the others.
class LineBudget {
 public:
  /// False: do not log. `unsaid`: lines that were kept back before this one.
  bool Take(int& unsaid) {
    const std::lock_guard lock(mutex_);
    const auto now = steady_clock::now();
    if (now - second_ >= std::chrono::seconds(1)) {
      second_ = now;
      lines_ = 0;
    }
    if (++lines_ > kLinesASecond) {
      ++unsaid_;
      return false;
    }
    unsaid = std::exchange(unsaid_, 0);
    return true;
  }

 private:
  std::mutex mutex_;
  steady_clock::time_point second_{};
  int lines_ = 0, unsaid_ = 0;
};

std::string CodeName(grpc::StatusCode code) {
  const std::string name = absl::StatusCodeToString(static_cast<absl::StatusCode>(code));
  return name.empty() ? std::to_string(code) : name;
}

class ObservedCall final : public grpc::experimental::Interceptor {
 public:
  ObservedCall(CallMetrics& metrics, LineBudget& budget, grpc::experimental::ServerRpcInfo& info)
      : metrics_(metrics), budget_(budget), info_(info), method_(info.method()) {
    metrics_.Began(method_);
  }

  // A call that never got as far as a status: the client was gone.
  ~ObservedCall() override {
    if (!ended_) metrics_.Ended(method_, CodeName(grpc::StatusCode::CANCELLED), Seconds());
  }

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (!ended_ && methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) {
      ended_ = true;
      const grpc::Status status = methods->GetSendStatus();
      metrics_.Ended(method_, CodeName(status.error_code()), Seconds());
      if (!status.ok()) Log(status, *methods);
    }
    methods->Proceed();
  }

 private:
  double Seconds() const { return std::chrono::duration<double>(steady_clock::now() - began_).count(); }

  void Log(const grpc::Status& status, grpc::experimental::InterceptorBatchMethods& methods) {
    int unsaid = 0;
    if (!budget_.Take(unsaid)) return;
    if (unsaid > 0) LogWarning("failed calls not logged", {{"calls", unsaid}});
    std::string request;
    if (const auto* trailers = methods.GetSendTrailingMetadata()) {
      if (const auto found = trailers->find("x-request-id"); found != trailers->end()) request = found->second;
    }
    const bool refused = status.error_code() == grpc::StatusCode::UNAUTHENTICATED ||
                         status.error_code() == grpc::StatusCode::PERMISSION_DENIED;
    const std::string peer = info_.server_context()->peer();
    const std::initializer_list<LogField> fields = {{"method", method_},
                                                    {"code", CodeName(status.error_code())},
                                                    {"why", status.error_message()},
                                                    {"peer", peer},
                                                    {"request", request},
                                                    {"seconds", Seconds()}};
    refused ? LogWarning("call refused", fields) : LogInfo("call failed", fields);
  }

  CallMetrics& metrics_;
  LineBudget& budget_;
  grpc::experimental::ServerRpcInfo& info_;
  const std::string method_;
  const steady_clock::time_point began_ = steady_clock::now();
  bool ended_ = false;
};

class CallObserver final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit CallObserver(CallMetrics& metrics) : metrics_(metrics) {}

  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override {
    return new ObservedCall(metrics_, budget_, *info);
  }

 private:
  CallMetrics& metrics_;
  LineBudget budget_;
};

}  // namespace

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> NewCallObserver(CallMetrics& metrics) {
  return std::make_unique<CallObserver>(metrics);
}

}  // namespace mapkeep
