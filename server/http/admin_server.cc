#include "server/http/admin_server.h"

#include <absl/strings/str_format.h>
#include <httplib.h>
#include <sys/socket.h>

#include <string>
#include <thread>
#include <utility>

#include "server/log.h"

namespace mapkeep {
namespace {

constexpr int kThreads = 4;
constexpr time_t kTimeoutSeconds = 5;
constexpr size_t kLargestRequest = 64 << 10;

}  // namespace

struct AdminServer::Listener {
  std::unique_ptr<httplib::Server> server;
  std::thread thread;
};

AdminServer::AdminServer(AdminServerParts parts) : parts_(std::move(parts)), listener_(std::make_unique<Listener>()) {
  if (parts_.certificates == nullptr) {
    listener_->server = std::make_unique<httplib::Server>();
  } else {
    listener_->server = std::make_unique<httplib::SSLServer>([this](SSL_CTX& context) {
      parts_.certificates->Serve(&context);
      return true;
    });
  }
}

absl::StatusOr<std::unique_ptr<AdminServer>> AdminServer::Start(const Endpoint& endpoint, AdminServerParts parts) {
  std::unique_ptr<AdminServer> admin(new AdminServer(std::move(parts)));
  httplib::Server& server = *admin->listener_->server;
  server.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
  server.set_read_timeout(kTimeoutSeconds);
  server.set_write_timeout(kTimeoutSeconds);
  server.set_payload_max_length(kLargestRequest);
  // The library's default shares the port with any other process that asks for it; a taken port must be an error.
  server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  server.Get("/livez",
             [](const httplib::Request&, httplib::Response& response) { response.set_content("ok\n", "text/plain"); });
  server.Get("/readyz", [&ready = admin->ready_](const httplib::Request&, httplib::Response& response) {
    response.status = ready ? 200 : 503;
    response.set_content(ready ? "ready\n" : "not ready\n", "text/plain");
  });
  server.Get("/metrics", [&parts = admin->parts_](const httplib::Request& request, httplib::Response& response) {
    const absl::Status allowed =
        parts.authority.Authorize(request.get_header_value("Authorization"), Access::kRead, Scope::All()).status();
    if (!allowed.ok()) {
      LogWarning("metrics refused", {{"peer", request.remote_addr}, {"why", std::string(allowed.message())}});
      response.status = absl::IsUnauthenticated(allowed) ? 401 : 403;
      if (response.status == 401) response.set_header("WWW-Authenticate", "Bearer");
      response.set_content(std::string(allowed.message()) + "\n", "text/plain");
      return;
    }
    response.set_content(parts.metrics(), "text/plain; version=0.0.4; charset=utf-8");
  });
  if (endpoint.port == 0) {
    admin->port_ = server.bind_to_any_port(endpoint.host);
  } else if (server.bind_to_port(endpoint.host, endpoint.port)) {
    admin->port_ = endpoint.port;
  }
  if (admin->port_ <= 0) {
    return absl::UnavailableError(
        absl::StrFormat("cannot listen on --admin %s: is the port taken?", ToString(endpoint)));
  }
  admin->listener_->thread = std::thread([&server] { server.listen_after_bind(); });
  return admin;
}

AdminServer::~AdminServer() {
  if (!listener_->thread.joinable()) return;
  // A stop that comes before the listening thread runs would be lost.
  while (!listener_->server->is_running()) std::this_thread::yield();
  listener_->server->stop();
  listener_->thread.join();
}

}  // namespace mapkeep
