#include "server/http/admin_server.h"

#include <absl/strings/str_format.h>
#include <httplib.h>
#include <sys/socket.h>

#include <string>
#include <thread>

namespace mapkeep {
namespace {

constexpr int kThreads = 4;
constexpr time_t kTimeoutSeconds = 5;
constexpr size_t kLargestRequest = 64 << 10;

}  // namespace

struct AdminServer::Listener {
  httplib::Server server;
  std::thread thread;
};

AdminServer::AdminServer() : listener_(std::make_unique<Listener>()) {}

absl::StatusOr<std::unique_ptr<AdminServer>> AdminServer::Start(const Endpoint& endpoint) {
  std::unique_ptr<AdminServer> admin(new AdminServer);
  httplib::Server& server = admin->listener_->server;
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
  while (!listener_->server.is_running()) std::this_thread::yield();
  listener_->server.stop();
  listener_->thread.join();
}

}  // namespace mapkeep
