#include "tests/bench/http_load.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <memory>
#include <stdexcept>

namespace mapkeep {
namespace {

int Connect(int port) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{.sin_family = AF_INET, .sin_port = htons(static_cast<uint16_t>(port)), .sin_addr = {}};
  inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
  if (connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    close(socket);
    throw std::runtime_error("cannot connect to port " + std::to_string(port));
  }
  return socket;
}

std::string RequestFor(const std::string& path, const std::string& extra) {
  return "GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\n" + extra + "\r\n";
}

// The length of the body that follows a header, which must be one of status 200.
size_t BodyLength(std::string_view header, const std::string& path) {
  constexpr std::string_view kField = "\r\nContent-Length: ";
  const size_t at = header.find(kField);
  size_t length = 0;
  if (!header.starts_with("HTTP/1.1 200") || at == std::string_view::npos) {
    throw std::runtime_error(path + ": " + std::string(header.substr(0, header.find('\r'))));
  }
  std::from_chars(header.data() + at + kField.size(), header.data() + header.size(), length);
  return length;
}

class Reader {
 public:
  Reader(int port, size_t first) : socket_(Connect(port)), next_(first) {}
  ~Reader() { close(socket_); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  int socket() const { return socket_; }

  void Ask(const std::vector<std::string>& paths, const std::string& extra) {
    path_ = paths[next_++ % paths.size()];
    const std::string request = RequestFor(path_, extra);
    if (send(socket_, request.data(), request.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(request.size())) {
      throw std::runtime_error(path_ + ": the request could not be sent");
    }
    header_.clear();
    in_body_ = false;
  }

  // Takes what is there, once; true when the answer is complete.
  bool Take(uint64_t& bytes) {
    static thread_local std::array<char, 256 << 10> buffer;
    const ssize_t count = recv(socket_, buffer.data(), buffer.size(), 0);
    if (count <= 0) throw std::runtime_error(path_ + ": the server closed the connection");
    auto rest = static_cast<size_t>(count);
    if (!in_body_) {
      header_.append(buffer.data(), rest);
      const size_t end = header_.find("\r\n\r\n");
      if (end == std::string::npos) return false;
      left_ = BodyLength(std::string_view(header_).substr(0, end + 2), path_);
      rest = header_.size() - end - 4;
      in_body_ = true;
    }
    bytes += rest;
    left_ -= rest;
    return left_ == 0;
  }

 private:
  const int socket_;
  size_t next_, left_ = 0;
  bool in_body_ = false;
  std::string path_, header_;
};

}  // namespace

HttpLoadResult RunHttpLoad(int port, const std::vector<std::string>& paths, int connections, double seconds,
                           const std::string& extra_header) {
  using Clock = std::chrono::steady_clock;
  const int poller = epoll_create1(EPOLL_CLOEXEC);
  std::vector<std::unique_ptr<Reader>> readers;
  for (int i = 0; i < connections; ++i) {
    readers.push_back(std::make_unique<Reader>(port, static_cast<size_t>(i) * paths.size() / connections));
    epoll_event event{.events = EPOLLIN, .data = {.ptr = readers.back().get()}};
    epoll_ctl(poller, EPOLL_CTL_ADD, readers.back()->socket(), &event);
  }
  HttpLoadResult result;
  const auto begin = Clock::now();
  const auto end = begin + std::chrono::duration<double>(seconds);
  for (const auto& reader : readers) reader->Ask(paths, extra_header);
  std::array<epoll_event, 64> ready;
  while (Clock::now() < end) {
    const int count = epoll_wait(poller, ready.data(), ready.size(), 1000);
    for (int i = 0; i < count; ++i) {
      auto* reader = static_cast<Reader*>(ready[i].data.ptr);
      if (!reader->Take(result.bytes)) continue;
      ++result.responses;
      reader->Ask(paths, extra_header);
    }
  }
  result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  close(poller);
  return result;
}

std::string HttpGet(int port, const std::string& path) {
  const int socket = Connect(port);
  const std::string request = RequestFor(path, "Connection: close\r\n");
  std::string answer;
  std::array<char, 64 << 10> buffer;
  (void)!send(socket, request.data(), request.size(), MSG_NOSIGNAL);
  for (ssize_t count = 0; (count = recv(socket, buffer.data(), buffer.size(), 0)) > 0;) {
    answer.append(buffer.data(), static_cast<size_t>(count));
  }
  close(socket);
  const size_t end = answer.find("\r\n\r\n");
  if (end == std::string::npos) throw std::runtime_error(path + ": no answer");
  const size_t length = BodyLength(std::string_view(answer).substr(0, end + 2), path);
  if (answer.size() - end - 4 != length) throw std::runtime_error(path + ": the answer is cut off");
  return answer.substr(end + 4);
}

}  // namespace mapkeep
