#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <unordered_set>

#include "server/http/page_server.h"

namespace mapkeep {

class Connection;

/// Every open connection of a server, so that they can be counted, made room among and closed. Thread-safe.
class ConnectionTable {
 public:
  explicit ConnectionTable(size_t most) : most_(most) {}

  /// False if the table is full and nobody can make room: all are at work.
  bool Add(const std::shared_ptr<Connection>& connection);
  void Remove(Connection* connection);
  size_t size() const;
  /// Closes those that wait for a request or for events; with `all`, every one.
  void Close(bool all);

 private:
  const size_t most_;
  mutable std::mutex mutex_;
  std::unordered_set<Connection*> open_;
};

/// What connections share; outlives them.
struct ConnectionContext {
  PageServerOptions options;
  PageHandler handler;
  std::shared_ptr<ConnectionTable> table;
  std::optional<boost::asio::ssl::context> tls;
  std::atomic<bool> stopping = false;
  std::atomic<uint64_t> requests = 0;
};

/// One client: reads a request, answers it, reads the next. Runs on the thread of its socket's context alone.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  virtual ~Connection() = default;
  /// Begins to read.
  virtual void Run() = 0;
  /// From any thread.
  virtual void Close() = 0;
  /// Since when it has waited for a request; max() while it is at work.
  std::chrono::steady_clock::time_point idle_since() const { return idle_since_; }

 protected:
  std::atomic<std::chrono::steady_clock::time_point> idle_since_ = std::chrono::steady_clock::now();
};

/// Over TLS if the context has it, else over plain TCP.
std::shared_ptr<Connection> NewConnection(boost::asio::ip::tcp::socket socket,
                                          std::shared_ptr<ConnectionContext> context);

}  // namespace mapkeep
