#include "server/http/page_server.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/error.hpp>
#include <thread>
#include <utility>
#include <vector>

#include "server/http/connection.h"

namespace mapkeep {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::beast::error_code;

constexpr auto kLookEvery = std::chrono::milliseconds(20);

// One thread and what runs on it.
struct Lane {
  asio::io_context context{1};
  asio::executor_work_guard<asio::io_context::executor_type> work = asio::make_work_guard(context);
  std::thread thread;
};

}  // namespace

// One lane a thread, sockets dealt out in turn: a connection needs no locks.
struct PageServer::Listener {
  std::vector<std::unique_ptr<Lane>> lanes;
  std::shared_ptr<ConnectionContext> context = std::make_shared<ConnectionContext>();
  std::unique_ptr<tcp::acceptor> acceptor;
  std::unique_ptr<asio::steady_timer> pause;
  size_t next = 0;
  bool stopped = false;

  absl::Status Listen(const Endpoint& endpoint) {
    const auto refused = [&endpoint](const error_code& error) {
      return absl::UnavailableError(
          absl::StrFormat("cannot listen on --http %s: %s", ToString(endpoint), error.message()));
    };
    asio::io_context& first = lanes.front()->context;
    error_code error;
    tcp::resolver resolver(first);
    const auto found = resolver.resolve(endpoint.host, std::to_string(endpoint.port),
                                        tcp::resolver::passive | tcp::resolver::numeric_service, error);
    if (error || found.empty()) return refused(error);
    acceptor = std::make_unique<tcp::acceptor>(first);
    pause = std::make_unique<asio::steady_timer>(first);
    const tcp::endpoint address = found.begin()->endpoint();
    acceptor->open(address.protocol(), error);
    if (!error) acceptor->set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor->bind(address, error);
    if (!error) acceptor->listen(asio::socket_base::max_listen_connections, error);
    return error ? refused(error) : absl::OkStatus();
  }

  void Accept() {
    asio::io_context& lane = lanes[next++ % lanes.size()]->context;
    acceptor->async_accept(lane, [this](error_code error, tcp::socket socket) {
      if (!acceptor->is_open()) return;
      if (error) return AcceptLater();
      Begin(std::move(socket));
      Accept();
    });
  }

  // No file descriptor left, most likely: some will be closed soon.
  void AcceptLater() {
    pause->expires_after(kLookEvery);
    pause->async_wait([this](error_code error) {
      if (!error && acceptor->is_open()) Accept();
    });
  }

  void Begin(tcp::socket socket) {
    error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    const auto connection = NewConnection(std::move(socket), context);
    if (context->table->Add(connection)) connection->Run();
  }

  void Stop(std::chrono::seconds patience) {
    if (std::exchange(stopped, true)) return;
    context->stopping = true;
    asio::post(lanes.front()->context, [this] {
      error_code ignored;
      if (acceptor) acceptor->close(ignored);
      if (pause) pause->cancel();
    });
    const auto end = std::chrono::steady_clock::now() + patience;
    context->table->Close(false);
    while (context->table->size() > 0 && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(kLookEvery);
    }
    context->table->Close(true);
    for (const auto& lane : lanes) lane->work.reset();
    // What was closed ends by itself; what still waits for the handler has nothing on a lane.
    for (const auto& lane : lanes) {
      if (lane->thread.joinable()) lane->thread.join();
    }
  }
};

PageServer::PageServer() : listener_(std::make_unique<Listener>()) {}

absl::StatusOr<std::unique_ptr<PageServer>> PageServer::Start(const Endpoint& endpoint,
                                                              const PageServerOptions& options, PageHandler handler) {
  std::unique_ptr<PageServer> server(new PageServer);
  Listener& listener = *server->listener_;
  listener.context->options = options;
  listener.context->handler = std::move(handler);
  listener.context->table = std::make_shared<ConnectionTable>(static_cast<size_t>(options.connections));
  if (options.tls) {
    listener.context->tls.emplace(asio::ssl::context::tls_server);
    options.tls(listener.context->tls->native_handle());
  }
  for (int i = 0; i < options.threads; ++i) listener.lanes.push_back(std::make_unique<Lane>());
  if (absl::Status status = listener.Listen(endpoint); !status.ok()) return status;
  error_code error;
  server->port_ = listener.acceptor->local_endpoint(error).port();
  listener.Accept();
  for (const auto& lane : listener.lanes) {
    lane->thread = std::thread([&context = lane->context] { context.run(); });
  }
  return server;
}

PageServer::~PageServer() { Stop(std::chrono::seconds(0)); }

size_t PageServer::connections() const { return listener_->context->table->size(); }

uint64_t PageServer::requests() const { return listener_->context->requests; }

void PageServer::Stop(std::chrono::seconds patience) { listener_->Stop(patience); }

}  // namespace mapkeep
