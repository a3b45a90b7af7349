#include "server/http/page_server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <thread>
#include <vector>

#include "server/http/event_stream.h"

namespace mapkeep {
namespace {

using std::chrono::seconds;
using std::chrono::steady_clock;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr seconds kPatience(60);  // for what must happen at all; nothing passes or fails by how fast

// A client that says what it likes.
class Client {
 public:
  explicit Client(int port) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{.sin_family = AF_INET, .sin_port = htons(static_cast<uint16_t>(port)), .sin_addr = {}};
    inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    EXPECT_EQ(connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  }
  ~Client() { close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void Say(const std::string& bytes) { (void)!send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }

  // More of what came; false at the end.
  bool Hear() {
    pollfd ready{.fd = socket_, .events = POLLIN, .revents = 0};
    if (poll(&ready, 1, static_cast<int>(std::chrono::milliseconds(kPatience).count())) != 1) {
      ADD_FAILURE() << "nothing came, nor an end";
      return false;
    }
    char bytes[1 << 16];
    const ssize_t count = recv(socket_, bytes, sizeof bytes, 0);
    if (count <= 0) return false;
    heard.append(bytes, static_cast<size_t>(count));
    return true;
  }
  std::string HearUntil(const std::string& end) {
    while (heard.find(end) == std::string::npos && Hear()) {
    }
    return heard;
  }
  std::string HearAll() {
    while (Hear()) {
    }
    return heard;
  }

  std::string heard;

 private:
  const int socket_;
};

PageResponse Text(const std::string& text) {
  return {.content_type = "text/plain", .body = std::make_shared<const std::string>(text)};
}

std::unique_ptr<PageServer> Serve(PageHandler handler, PageServerOptions options = {}) {
  auto server = PageServer::Start({"127.0.0.1", 0}, options, std::move(handler));
  EXPECT_TRUE(server.ok()) << server.status();
  return *std::move(server);
}

std::unique_ptr<PageServer> ServePaths(PageServerOptions options = {}) {
  return Serve(
      [](const PageRequest& request, const Respond& respond) {
        respond(Text("path " + (request.target.path.empty() ? "none" : request.target.path.back()) + "\n"));
      },
      options);
}

TEST(PageServer, AnswersOneRequestAfterTheOtherOnOneConnection) {
  const auto server = ServePaths();
  Client client(server->port());
  client.Say("GET /a HTTP/1.1\r\nHost: x\r\n\r\nGET /b HTTP/1.1\r\nHost: x\r\n\r\n");  // both at once
  client.HearUntil("path b\n");
  client.Say("GET /c HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  const std::string heard = client.HearAll();
  EXPECT_THAT(heard, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_LT(heard.find("path a\n"), heard.find("path b\n"));
  EXPECT_LT(heard.find("path b\n"), heard.find("path c\n"));
  EXPECT_THAT(heard, HasSubstr("Content-Length: 7\r\n"));
}

TEST(PageServer, AHeadIsTheHeaderAlone) {
  const auto server = ServePaths();
  Client client(server->port());
  client.Say("HEAD /a HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  const std::string heard = client.HearAll();
  EXPECT_THAT(heard, HasSubstr("Content-Length: 7\r\n"));
  EXPECT_THAT(heard, Not(HasSubstr("path a")));
}

TEST(PageServer, WhatIsNoGoodRequestGetsItsStatusAndHarmsNobody) {
  const auto server = ServePaths({.stall_seconds = 1});
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"POST / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", "405"},
      {"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\n\r\nhello", "413"},
      {"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nhello\r\n0\r\n\r\n", "413"},
      {"GET /../etc/passwd HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", "400"},
      {"GET /a%2f.. HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", "400"},
      {"this is no request\r\n\r\n", "400"},
      {"GET / HTTP/9.9\r\n\r\n", "400"},
      {"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", "400"},
      {std::string("\x16\x03\x01\x02\x00\x01\x00", 7) + "\r\n\r\n", "400"},
      {"GET / HTTP/1.1\r\nHost: x\r\nX: " + std::string(100000, 'a') + "\r\n\r\n", "431"},
      {"OPTIONS /a HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", "204"},
  };
  for (const auto& [request, status] : cases) {
    Client client(server->port());
    client.Say(request);
    EXPECT_THAT(client.HearAll(), StartsWith("HTTP/1.1 " + status)) << request.substr(0, 60);
  }
  Client client(server->port());
  client.Say("GET /still HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(client.HearAll(), HasSubstr("path still"));
}

TEST(PageServer, AnswersMayComeLaterAndFromAnotherThread) {
  std::vector<std::jthread> threads;
  const auto server = Serve([&threads](const PageRequest&, Respond respond) {
    threads.emplace_back([respond = std::move(respond)] {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      respond(Text("late\n"));
    });
  });
  Client client(server->port());
  client.Say("GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(client.HearAll(), HasSubstr("late\n"));
}

TEST(PageServer, TheFieldsReachTheHandler) {
  const auto server = Serve([](const PageRequest& request, const Respond& respond) {
    respond(Text(request.token + "|" + request.accept_encoding + "|" + request.if_none_match + "|" + request.range +
                 "|" + request.last_event_id));
  });
  Client client(server->port());
  client.Say(
      "GET /?token=query HTTP/1.1\r\nHost: x\r\nauthorization: bearer secret\r\nAccept-Encoding: "
      "gzip\r\nIf-None-Match: "
      "\"a\"\r\nRange: bytes=1-\r\nLast-Event-ID: 7\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(client.HearAll(), HasSubstr("secret|gzip|\"a\"|bytes=1-|7"));
  Client second(server->port());
  second.Say("GET /?token=query HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(second.HearAll(), HasSubstr("query||||"));
}

TEST(PageServer, AClientThatTakesNothingIsCutOffAndTheOthersDoNotNotice) {
  const std::string large(64 << 20, 'x');
  const auto body = std::make_shared<const std::string>(large);
  const auto server = Serve(
      [body](const PageRequest& request, const Respond& respond) {
        if (request.target.path.empty()) return respond({.content_type = "x", .body = body});
        respond(Text("small\n"));
      },
      {.threads = 1, .stall_seconds = 1});
  Client slow(server->port());
  slow.Say("GET / HTTP/1.1\r\nHost: x\r\n\r\n");
  slow.Hear();
  Client quick(server->port());
  quick.Say("GET /small HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(quick.HearAll(), HasSubstr("small\n"));
  // Held by this test, the lambda and, while it is being sent, by the connection.
  for (const auto end = steady_clock::now() + kPatience; body.use_count() > 2 && steady_clock::now() < end;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_EQ(body.use_count(), 2);
  EXPECT_LT(slow.HearAll().size(), large.size());
}

TEST(PageServer, ALargeBodyArrivesWhole) {
  std::string large(8 << 20, 'x');
  for (size_t i = 0; i < large.size(); i += 4096) large[i] = static_cast<char>('a' + i / 4096 % 26);
  const auto server = Serve([&large](const PageRequest&, const Respond& respond) { respond(Text(large)); });
  Client client(server->port());
  client.Say("GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  const std::string heard = client.HearAll();
  EXPECT_TRUE(heard.substr(heard.find("\r\n\r\n") + 4) == large);
}

TEST(PageServer, ARequestThatNeverEndsIsCutOff) {
  const auto server = ServePaths({.stall_seconds = 1});
  Client client(server->port());
  client.Say("GET / HTT");
  EXPECT_EQ(client.HearAll(), "");
}

TEST(PageServer, WhoWasSilentLongestMakesRoom) {
  const auto server = ServePaths({.connections = 2});
  Client first(server->port());
  first.Say("GET /a HTTP/1.1\r\nHost: x\r\n\r\n");
  first.HearUntil("path a\n");
  Client second(server->port());
  second.Say("GET /b HTTP/1.1\r\nHost: x\r\n\r\n");
  second.HearUntil("path b\n");
  Client third(server->port());
  third.Say("GET /c HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(third.HearUntil("path c\n"), HasSubstr("path c\n"));
  first.HearAll();  // ends
  second.Say("GET /d HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(second.HearUntil("path d\n"), HasSubstr("path d\n"));
}

TEST(PageServer, SaysWhosePagesMayReadIt) {
  const auto server = ServePaths({.cors_origins = "https://a.example https://b.example"});
  const auto ask = [&server](const std::string& origin) {
    Client client(server->port());
    client.Say("GET / HTTP/1.1\r\nHost: x\r\nOrigin: " + origin + "\r\nConnection: close\r\n\r\n");
    return client.HearAll();
  };
  EXPECT_THAT(ask("https://b.example"), HasSubstr("Access-Control-Allow-Origin: https://b.example\r\n"));
  EXPECT_THAT(ask("https://b.example.evil"), Not(HasSubstr("Access-Control-Allow-Origin")));
  EXPECT_THAT(ask("https://c.example"), Not(HasSubstr("Access-Control-Allow-Origin")));
}

TEST(PageServer, StreamsEventsUntilTheyEnd) {
  const auto events = std::make_shared<EventStream>();
  events->Send("epoch", "{\"epoch\":1}", "1");
  const auto server = Serve([&events](const PageRequest&, const Respond& respond) {
    respond({.content_type = "text/event-stream", .events = events});
  });
  Client client(server->port());
  client.Say("GET / HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(client.HearUntil("}\n\n"), HasSubstr("event: epoch\nid: 1\ndata: {\"epoch\":1}\n\n"));
  events->Send("session", "{}");
  EXPECT_THAT(client.HearUntil("{}\n\n"), HasSubstr("event: session\ndata: {}\n\n"));
  events->End();
  client.HearAll();
}

TEST(PageServer, AStopLetsAnswersUnderWayEnd) {
  Respond later;
  std::atomic<bool> asked = false;
  auto server = Serve([&](const PageRequest&, Respond respond) {
    later = std::move(respond);
    asked = true;
  });
  Client client(server->port());
  client.Say("GET / HTTP/1.1\r\nHost: x\r\n\r\n");
  while (!asked) std::this_thread::yield();
  std::thread stopping([&server] { server->Stop(kPatience); });
  later(Text("done\n"));
  later = nullptr;
  EXPECT_THAT(client.HearAll(), HasSubstr("done\n"));
  stopping.join();
}

TEST(PageServer, ATakenPortIsAnError) {
  const auto server = ServePaths();
  const auto second = PageServer::Start({"127.0.0.1", server->port()}, {}, [](PageRequest, const Respond&) {});
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(second.status().message()), HasSubstr("--http 127.0.0.1"));
}

}  // namespace
}  // namespace mapkeep
