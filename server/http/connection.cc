#include "server/http/connection.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <array>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "server/http/event_stream.h"
#include "server/http/response_header.h"

namespace mapkeep {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using Clock = std::chrono::steady_clock;
using TlsStream = beast::ssl_stream<beast::tcp_stream>;

constexpr uint32_t kLargestHeader = 16 << 10;
constexpr size_t kReadSize = 4 << 10;
constexpr int kGoodbyeSeconds = 2;
constexpr size_t kWriteSize = 256 << 10;  // bytes offered to the kernel at a time: each gets its own patience
constexpr std::chrono::seconds kHeartbeat(15);

std::string FieldOf(const http::request_header<>& request, http::field name) {
  const auto found = request.find(name);
  return found == request.end() ? std::string() : std::string(found->value());
}

std::string FieldOf(const http::request_header<>& request, const char* name) {
  const auto found = request.find(name);
  return found == request.end() ? std::string() : std::string(found->value());
}

// The token of the Authorization field, or of the query for those who cannot set a field.
std::string TokenOf(const http::request_header<>& request, const RequestTarget& target) {
  constexpr size_t kScheme = 7;
  const std::string field = FieldOf(request, http::field::authorization);
  if (absl::StartsWithIgnoreCase(field, "bearer ")) return field.substr(kScheme);
  return target.Query("token");
}

// Bytes came, and they are no HTTP/1.1 request.
bool IsNoRequest(const beast::error_code& error) {
  static const auto& http_errors = make_error_code(http::error::bad_method).category();
  return error && error.category() == http_errors && error != http::error::end_of_stream &&
         error != http::error::partial_message;
}

template <typename Stream>
class StreamConnection final : public Connection {
 public:
  StreamConnection(Stream stream, std::shared_ptr<ConnectionContext> context)
      : stream_(std::move(stream)), context_(std::move(context)), heartbeat_(stream_.get_executor()) {}

  ~StreamConnection() override { context_->table->Remove(this); }

  void Run() override {
    asio::dispatch(stream_.get_executor(), [self = Self()] { self->Begin(); });
  }

  void Close() override {
    asio::post(stream_.get_executor(), [self = Self()] { self->CloseNow(); });
  }

 private:
  std::shared_ptr<StreamConnection> Self() { return std::static_pointer_cast<StreamConnection>(shared_from_this()); }

  void CloseNow() {
    if (events_) events_->OnReady({});
    heartbeat_.cancel();
    beast::get_lowest_layer(stream_).close();
  }

  void Patience(int seconds) { beast::get_lowest_layer(stream_).expires_after(std::chrono::seconds(seconds)); }

  void Begin() {
    if constexpr (std::is_same_v<Stream, TlsStream>) {
      Patience(context_->options.stall_seconds);
      stream_.async_handshake(asio::ssl::stream_base::server, [self = Self()](beast::error_code error) {
        if (error) return self->CloseNow();
        self->Read();
      });
    } else {
      Read();
    }
  }

  void Read() {
    if (context_->stopping) return CloseNow();
    parser_.emplace();
    parser_->header_limit(kLargestHeader);
    parser_->body_limit(0);
    idle_since_ = Clock::now();
    // Idle until the first byte; from there on the whole request has to come soon.
    if (buffer_.size() > 0) return ReadHeader();
    Patience(context_->options.idle_seconds);
    stream_.async_read_some(buffer_.prepare(kReadSize), [self = Self()](beast::error_code error, size_t read) {
      if (error) return self->CloseNow();
      self->buffer_.commit(read);
      self->ReadHeader();
    });
  }

  void ReadHeader() {
    Patience(context_->options.stall_seconds);
    http::async_read(stream_, buffer_, *parser_,
                     [self = Self()](beast::error_code error, size_t) { self->OnRead(error); });
  }

  void OnRead(beast::error_code error) {
    if (error == http::error::header_limit) return Refuse(431, "INVALID_ARGUMENT", "the header is larger than 16 KiB");
    if (error == http::error::body_limit || error == http::error::unexpected_body) {
      return Refuse(413, "INVALID_ARGUMENT", "requests have no body here");
    }
    if (IsNoRequest(error)) {
      return Refuse(400, "INVALID_ARGUMENT", absl::StrCat("not a request: ", error.message()));
    }
    if (error) return CloseNow();
    idle_since_ = Clock::time_point::max();
    Answer();
  }

  // An answer after which nothing of what else the client says can be understood.
  void Refuse(int status, const char* code, const std::string& message) {
    keep_alive_ = false;
    head_only_ = false;
    origin_.clear();
    idle_since_ = Clock::time_point::max();
    Write(ErrorPage(status, code, message));
  }

  void Answer() {
    ++context_->requests;
    const http::request<http::empty_body> request = parser_->release();
    keep_alive_ = request.keep_alive();
    head_only_ = request.method() == http::verb::head;
    origin_ = FieldOf(request, http::field::origin);
    if (request.method() == http::verb::options) {
      PageResponse page{.status = 204, .content_type = ""};
      page.headers.emplace_back("Allow", "GET, HEAD, OPTIONS");
      return Write(std::move(page));
    }
    if (request.method() != http::verb::get && !head_only_) {
      PageResponse page = ErrorPage(405, "UNIMPLEMENTED", "expected GET, HEAD or OPTIONS");
      page.headers.emplace_back("Allow", "GET, HEAD, OPTIONS");
      return Write(std::move(page));
    }
    auto target = ParseRequestTarget({request.target().data(), request.target().size()});
    if (!target.ok()) return Write(ErrorPage(target.status()));
    PageRequest page;
    page.token = TokenOf(request, *target);
    page.target = *std::move(target);
    page.accept_encoding = FieldOf(request, http::field::accept_encoding);
    page.if_none_match = FieldOf(request, http::field::if_none_match);
    page.range = FieldOf(request, http::field::range);
    page.if_range = FieldOf(request, http::field::if_range);
    page.last_event_id = FieldOf(request, "Last-Event-ID");
    beast::get_lowest_layer(stream_).expires_never();
    context_->handler(std::move(page), [self = Self()](PageResponse response) {
      asio::dispatch(self->stream_.get_executor(),
                     [self, response = std::move(response)]() mutable { self->Write(std::move(response)); });
    });
  }

  void Write(PageResponse response) {
    if (context_->stopping) keep_alive_ = false;
    response_ = std::move(response);
    header_ = ResponseHeader(response_, {.keep_alive = keep_alive_ && !response_.events,
                                         .origin = origin_,
                                         .allowed_origins = context_->options.cors_origins,
                                         .shared_caches = context_->options.shared_caches});
    const bool has_body = !head_only_ && response_.status != 304 && response_.status != 204;
    body_ = has_body ? BodyOf(response_) : std::string_view();
    WriteSome();
  }

  void WriteSome() {
    Patience(context_->options.stall_seconds);
    const std::string_view body = body_.substr(0, kWriteSize);
    const std::array<asio::const_buffer, 2> buffers = {asio::buffer(header_), asio::buffer(body.data(), body.size())};
    stream_.async_write_some(buffers, [self = Self()](beast::error_code error, size_t written) {
      if (error) return self->CloseNow();
      self->OnWritten(written);
    });
  }

  void OnWritten(size_t written) {
    const size_t of_header = std::min(written, header_.size());
    header_.erase(0, of_header);
    body_.remove_prefix(written - of_header);
    if (!header_.empty() || !body_.empty()) return WriteSome();
    if (events_) return PumpEvents();
    std::shared_ptr<EventStream> events = std::move(response_.events);
    response_ = {};
    if (events && !head_only_) return BeginEvents(std::move(events));
    if (!keep_alive_) return Shutdown();
    Read();
  }

  // The end of what this side says. The client has a moment to see it: closing at once with bytes of his unread would
  // reset the connection under the answer.
  void Shutdown() {
    if constexpr (std::is_same_v<Stream, TlsStream>) {
      Patience(kGoodbyeSeconds);
      stream_.async_shutdown([self = Self()](beast::error_code) { self->CloseNow(); });
      return;
    }
    beast::error_code ignored;
    beast::get_lowest_layer(stream_).socket().shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
    Patience(kGoodbyeSeconds);
    Drain();
  }

  void Drain() {
    beast::get_lowest_layer(stream_).async_read_some(asio::buffer(waste_),
                                                     [self = Self()](beast::error_code error, size_t) {
                                                       if (error) return self->CloseNow();
                                                       self->Drain();
                                                     });
  }

  void BeginEvents(std::shared_ptr<EventStream> events) {
    events_ = std::move(events);
    events_->OnReady([weak = std::weak_ptr<StreamConnection>(Self())] {
      const auto self = weak.lock();
      if (self == nullptr) return;
      asio::post(self->stream_.get_executor(), [self] {
        if (self->events_waiting_) self->PumpEvents();
      });
    });
    PumpEvents();
  }

  // Writes what there is, or waits for more; silence is broken by a comment, which also finds clients that went away.
  void PumpEvents() {
    events_waiting_ = false;
    heartbeat_.cancel();
    if (context_->stopping) events_->End();
    header_ = events_->Take();
    if (!header_.empty()) return WriteSome();
    if (events_->ended()) return Shutdown();
    events_waiting_ = true;
    beast::get_lowest_layer(stream_).expires_never();
    heartbeat_.expires_after(kHeartbeat);
    heartbeat_.async_wait([self = Self()](beast::error_code error) {
      if (error || !self->events_waiting_) return;
      self->events_waiting_ = false;
      self->header_ = ": still here\n\n";
      self->WriteSome();
    });
  }

  Stream stream_;
  const std::shared_ptr<ConnectionContext> context_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::empty_body>> parser_;
  bool keep_alive_ = false, head_only_ = false;
  std::string origin_;
  PageResponse response_;
  std::string header_;     // what is left of it
  std::string_view body_;  // what is left of response_.body
  std::shared_ptr<EventStream> events_;
  bool events_waiting_ = false;
  asio::steady_timer heartbeat_;
  std::array<char, 4096> waste_;
};

}  // namespace

bool ConnectionTable::Add(const std::shared_ptr<Connection>& connection) {
  std::shared_ptr<Connection> closing;  // let go of after the lock: its end takes the lock
  const std::scoped_lock lock(mutex_);
  if (open_.size() >= most_) {
    const auto idlest = std::ranges::min_element(open_, {}, [](const Connection* c) { return c->idle_since(); });
    if (idlest == open_.end() || (*idlest)->idle_since() == Clock::time_point::max()) return false;
    closing = (*idlest)->weak_from_this().lock();
    if (closing) closing->Close();
    open_.erase(idlest);
  }
  open_.insert(connection.get());
  return true;
}

void ConnectionTable::Remove(Connection* connection) {
  const std::scoped_lock lock(mutex_);
  open_.erase(connection);
}

size_t ConnectionTable::size() const {
  const std::scoped_lock lock(mutex_);
  return open_.size();
}

void ConnectionTable::Close(bool all) {
  std::vector<std::shared_ptr<Connection>> closing;
  {
    const std::scoped_lock lock(mutex_);
    for (Connection* connection : open_) {
      if (!all && connection->idle_since() == Clock::time_point::max()) continue;
      if (auto held = connection->weak_from_this().lock()) closing.push_back(std::move(held));
    }
  }
  for (const auto& connection : closing) connection->Close();
}

std::shared_ptr<Connection> NewConnection(asio::ip::tcp::socket socket, std::shared_ptr<ConnectionContext> context) {
  beast::tcp_stream stream(std::move(socket));
  if (context->tls) {
    TlsStream over_tls(std::move(stream), *context->tls);
    return std::make_shared<StreamConnection<TlsStream>>(std::move(over_tls), std::move(context));
  }
  return std::make_shared<StreamConnection<beast::tcp_stream>>(std::move(stream), std::move(context));
}

}  // namespace mapkeep
