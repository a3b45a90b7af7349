#pragma once

#include <string>

namespace mapkeep {

/// What no gRPC library would send: HTTP/2 frames by hand (RFC 9113), headers as HPACK literals (RFC 7541, 6.2.2).
namespace raw {

constexpr char kData = 0, kHeaders = 1, kSettings = 4;
constexpr char kEndHeaders = 4, kEndStream = 1;

std::string Frame(char type, char flags, char stream, const std::string& payload);
/// The headers of a gRPC call.
std::string CallHeaders(const std::string& path);
/// A gRPC message, not compressed.
std::string Message(const std::string& bytes);
/// What a connection begins with.
std::string Preface();

/// A TCP connection that does what it is told and nothing by itself: answers no ping, reads nothing.
class Connection {
 public:
  /// HOST:PORT on loopback. Not open() if it was refused.
  explicit Connection(const std::string& address);
  ~Connection();
  Connection(Connection&& other) noexcept;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  bool open() const { return socket_ >= 0; }
  void Send(const std::string& bytes) const;
  /// What comes until the peer closes, says `until`, or `seconds` pass in silence.
  std::string Receive(const std::string& until, int seconds) const;
  /// Whether the peer has closed by then.
  bool ClosedWithin(int seconds) const;

 private:
  int socket_ = -1;
};

}  // namespace raw
}  // namespace mapkeep
