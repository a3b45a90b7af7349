// tile_streaming_bench --http HOST:PORT --listen HOST:PORT --map NAME [--seconds S] [--rounds N] [--connections N]
//
// How fast a running mapkeepd streams the tiles of a map to readers that take all they can get: over HTTP, as plain and
// as packed bytes, and over gRPC (GetTiles), each in turns with nginx serving the very same bytes as files: the tiles
// of HTTP, the messages of gRPC. Bytes of bodies; one thread reads over as many connections in all cases, and parses
// nothing.

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "mapkeep/v1/tile_service.grpc.pb.h"
#include "tests/bench/http_load.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Options {
  std::string http, listen, map;
  double seconds = 2;
  int rounds = 3, connections = 8, nginx_port = 18480;
};

int PortOf(const std::string& address) { return std::stoi(address.substr(address.rfind(':') + 1)); }

void CollectTiles(const nlohmann::json& tile, const std::string& base, int port, std::vector<std::string>& paths) {
  if (tile.contains("content")) {
    const std::string path = base + tile["content"]["uri"].get<std::string>();
    if (path.ends_with(".json")) {
      const auto below = nlohmann::json::parse(HttpGet(port, path));
      CollectTiles(below["root"], path.substr(0, path.rfind('/') + 1), port, paths);
    } else {
      paths.push_back(path);
    }
  }
  if (!tile.contains("children")) return;
  for (const auto& child : tile["children"]) CollectTiles(child, base, port, paths);
}

// nginx on a folder, as a package of Debian configures it: sendfile, one worker a core, no log.
class Nginx {
 public:
  Nginx(const fs::path& folder, int port) {
    const fs::path configuration = folder / "nginx.conf";
    std::ofstream(configuration) << "daemon off;\nworker_processes auto;\npid " << (folder / "pid").string()
                                 << ";\nerror_log stderr crit;\nevents { worker_connections 1024; }\nhttp {\n"
                                 << "  sendfile on; tcp_nopush on; access_log off; keepalive_requests 1000000;\n"
                                 << "  open_file_cache max=10000; types { model/gltf-binary glb; }\n"
                                 << "  server { listen 127.0.0.1:" << port << "; root " << (folder / "files").string()
                                 << "; }\n}\n";
    process_ = fork();
    if (process_ == 0) {
      execlp("nginx", "nginx", "-c", configuration.c_str(), "-p", folder.c_str(), nullptr);
      _exit(127);
    }
  }
  ~Nginx() {
    kill(process_, SIGTERM);
    waitpid(process_, nullptr, 0);
  }
  Nginx(const Nginx&) = delete;
  Nginx& operator=(const Nginx&) = delete;

 private:
  pid_t process_ = -1;
};

// The whole map again and again, over a connection of its own: asks, takes messages, and begins anew at the end.
class GrpcReader {
 public:
  GrpcReader(const Options& options, grpc::CompletionQueue& queue) : options_(options), queue_(queue) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetInt(GRPC_ARG_HTTP2_MAX_FRAME_SIZE, kFrameBytes);
    arguments.SetMaxReceiveMessageSize(-1);
    stub_ = std::make_unique<grpc::GenericStub>(
        grpc::CreateCustomChannel(options.listen, grpc::InsecureChannelCredentials(), arguments));
    Begin();
  }

  // What the last event brought: a message or nothing. The next thing is under way then.
  std::optional<grpc::ByteBuffer> Take(bool ok) {
    switch (state_) {
      case State::kStarting:
        state_ = State::kAsking;
        if (ok) {
          Ask();
        } else {
          state_ = State::kFinishing;
          call_->Finish(&status_, this);
        }
        return std::nullopt;
      case State::kAsking:
        state_ = State::kReading;
        call_->Read(&message_, this);
        return std::nullopt;
      case State::kReading:
        if (ok) {
          grpc::ByteBuffer message;
          message.Swap(&message_);
          call_->Read(&message_, this);
          return message;
        }
        state_ = State::kFinishing;
        call_->Finish(&status_, this);
        return std::nullopt;
      case State::kFinishing:
        if (!ending_ && !status_.ok()) throw std::runtime_error(status_.error_message());
        ended_ = true;
        if (!ending_) Begin();
        return std::nullopt;
    }
    return std::nullopt;
  }

  void End() {
    ending_ = true;
    context_->TryCancel();
  }
  /// After End, once nothing is under way.
  bool ended() const { return ended_; }

 private:
  enum class State { kStarting, kAsking, kReading, kFinishing };
  static constexpr int kFrameBytes = 1 << 20;

  void Begin() {
    ended_ = false;
    state_ = State::kStarting;
    call_.reset();
    context_ = std::make_unique<grpc::ClientContext>();
    call_ = stub_->PrepareCall(context_.get(), "/mapkeep.v1.TileService/GetTiles", &queue_);
    call_->StartCall(this);
  }

  void Ask() {
    v1::GetTilesRequest request;
    request.set_map(options_.map);
    const grpc::Slice slice(request.SerializeAsString());
    call_->WriteLast(grpc::ByteBuffer(&slice, 1), {}, this);
  }

  const Options& options_;
  grpc::CompletionQueue& queue_;
  std::unique_ptr<grpc::GenericStub> stub_;
  std::unique_ptr<grpc::ClientContext> context_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
  grpc::ByteBuffer message_;
  grpc::Status status_;
  State state_ = State::kStarting;
  bool ending_ = false, ended_ = false;
};

// Gives each message to `take` until that says it is enough.
void ReadGrpc(const Options& options, int connections, const std::function<bool(grpc::ByteBuffer)>& take) {
  grpc::CompletionQueue queue;
  std::vector<std::unique_ptr<GrpcReader>> readers;
  for (int i = 0; i < connections; ++i) readers.push_back(std::make_unique<GrpcReader>(options, queue));
  void* tag = nullptr;
  bool ok = false, ending = false;
  while (std::any_of(readers.begin(), readers.end(), [&](const auto& one) { return !ending || !one->ended(); })) {
    if (!queue.Next(&tag, &ok)) break;
    auto message = static_cast<GrpcReader*>(tag)->Take(ok);
    if (!message || ending || take(*std::move(message))) continue;
    ending = true;
    for (const auto& reader : readers) reader->End();
  }
  queue.Shutdown();
  while (queue.Next(&tag, &ok)) continue;
}

HttpLoadResult RunGrpcLoad(const Options& options) {
  HttpLoadResult result;
  const auto begin = Clock::now();
  const auto end = begin + std::chrono::duration<double>(options.seconds);
  ReadGrpc(options, options.connections, [&](const grpc::ByteBuffer& message) {
    result.bytes += message.Length();
    ++result.responses;
    result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    return Clock::now() < end;
  });
  return result;
}

// The messages of one call.
std::vector<std::string> GrpcMessages(const Options& options) {
  std::vector<std::string> messages;
  ReadGrpc(options, 1, [&](const grpc::ByteBuffer& message) {
    std::vector<grpc::Slice> slices;
    if (!message.Dump(&slices).ok()) throw std::runtime_error("a message without bytes");
    std::string bytes;
    for (const grpc::Slice& slice : slices) bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
    // The header comes again when the call begins anew.
    if (!messages.empty() && bytes == messages.front()) return false;
    messages.push_back(std::move(bytes));
    return true;
  });
  return messages;
}

double MegabytesPerSecond(const HttpLoadResult& result) {
  return static_cast<double>(result.bytes) / 1e6 / result.seconds;
}

void Run(const Options& options) {
  const int port = PortOf(options.http);
  const std::string base = "/v1/maps/" + options.map + "/latest/";
  std::vector<std::string> found, paths;
  CollectTiles(nlohmann::json::parse(HttpGet(port, base + "tileset.json"))["root"], base, port, found);
  // "../epochs/1/..." as a browser asks for it.
  for (const std::string& path : found) paths.push_back(fs::path(path).lexically_normal().string());

  std::string scratch = (fs::temp_directory_path() / "mapkeep-nginx-XXXXXX").string();
  const fs::path folder = mkdtemp(scratch.data());
  fs::permissions(folder, fs::perms(0755));
  uint64_t total = 0;
  for (const std::string& path : paths) {
    const fs::path file = folder / "files" / path.substr(1);
    fs::create_directories(file.parent_path());
    const std::string bytes = HttpGet(port, path);
    std::ofstream(file, std::ios::binary) << bytes;
    total += bytes.size();
  }
  std::vector<std::string> grpc_paths;
  uint64_t grpc_total = 0;
  fs::create_directories(folder / "files" / "grpc");
  for (const std::string& message : GrpcMessages(options)) {
    grpc_paths.push_back("/grpc/" + std::to_string(grpc_paths.size()));
    std::ofstream(folder / "files" / grpc_paths.back().substr(1), std::ios::binary) << message;
    grpc_total += message.size();
  }
  std::printf("%zu tiles, %.1f MB over HTTP; %zu messages, %.1f MB over gRPC; %d connections, %.1f s a measurement\n",
              paths.size(), static_cast<double>(total) / 1e6, grpc_paths.size(), static_cast<double>(grpc_total) / 1e6,
              options.connections, options.seconds);
  {
    const Nginx nginx(folder, options.nginx_port);
    for (int i = 0;; ++i) {
      try {
        HttpGet(options.nginx_port, paths[0]);
        break;
      } catch (const std::exception&) {
        if (i == 100) throw std::runtime_error("nginx does not serve; is it installed?");
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      }
    }
    std::printf("%10s %12s %9s %12s %12s %9s\n", "nginx", "HTTP", "ratio", "nginx", "gRPC", "ratio");
    for (int round = 0; round < options.rounds; ++round) {
      const double nginx_rate =
          MegabytesPerSecond(RunHttpLoad(options.nginx_port, paths, options.connections, options.seconds));
      const double http = MegabytesPerSecond(RunHttpLoad(port, paths, options.connections, options.seconds));
      const double nginx_grpc =
          MegabytesPerSecond(RunHttpLoad(options.nginx_port, grpc_paths, options.connections, options.seconds));
      const double grpc = MegabytesPerSecond(RunGrpcLoad(options));
      std::printf("%5.0f MB/s %7.0f MB/s %7.0f %% %7.0f MB/s %7.0f MB/s %7.0f %%\n", nginx_rate, http,
                  100 * http / nginx_rate, nginx_grpc, grpc, 100 * grpc / nginx_grpc);
    }
    const HttpLoadResult packed =
        RunHttpLoad(port, paths, options.connections, options.seconds, "Accept-Encoding: zstd\r\n");
    std::printf("packed (zstd): %.0f MB/s on the wire, %.0f tiles/s\n", MegabytesPerSecond(packed),
                static_cast<double>(packed.responses) / packed.seconds);
  }
  fs::remove_all(folder);
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) {
  mapkeep::Options options;
  CLI::App app("Streaming of tiles by a running mapkeepd beside nginx with the same bytes as files");
  app.add_option("--http", options.http, "HOST:PORT of pages and tiles, on this machine")->required();
  app.add_option("--listen", options.listen, "HOST:PORT of gRPC")->required();
  app.add_option("--map", options.map)->required();
  app.add_option("--seconds", options.seconds, "of a measurement");
  app.add_option("--rounds", options.rounds);
  app.add_option("--connections", options.connections);
  app.add_option("--nginx-port", options.nginx_port);
  CLI11_PARSE(app, argc, argv);
  try {
    mapkeep::Run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "tile_streaming_bench: %s\n", error.what());
    return 1;
  }
  return 0;
}
