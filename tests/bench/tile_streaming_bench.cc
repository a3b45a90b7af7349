// tile_streaming_bench --http HOST:PORT --listen HOST:PORT --map NAME [--seconds S] [--rounds N] [--connections N]
//
// How fast a running mapkeepd streams the tiles of a map to readers that take all they can get: over HTTP, as plain and
// as packed bytes, and over gRPC, in turns with nginx serving the very same bytes as files. Bytes of bodies; one thread
// reads in all cases.

#include <grpcpp/grpcpp.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
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

// The whole map again and again: bytes of messages.
HttpLoadResult RunGrpcLoad(const Options& options) {
  const auto stub = v1::TileService::NewStub(grpc::CreateChannel(options.listen, grpc::InsecureChannelCredentials()));
  HttpLoadResult result;
  const auto begin = Clock::now();
  const auto end = begin + std::chrono::duration<double>(options.seconds);
  while (Clock::now() < end) {
    grpc::ClientContext call;
    v1::StreamTilesRequest request;
    request.set_map(options.map);
    const auto stream = stub->StreamTiles(&call, request);
    v1::StreamTilesResponse response;
    while (stream->Read(&response)) result.bytes += response.ByteSizeLong();
    if (const grpc::Status status = stream->Finish(); !status.ok()) throw std::runtime_error(status.error_message());
    ++result.responses;
  }
  result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  return result;
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
  std::printf("%zu tiles, %.1f MB, %d connections, %.1f s a measurement\n", paths.size(),
              static_cast<double>(total) / 1e6, options.connections, options.seconds);
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
    std::printf("%10s %12s %9s %12s %9s\n", "nginx", "HTTP", "ratio", "gRPC", "ratio");
    for (int round = 0; round < options.rounds; ++round) {
      const double nginx_rate =
          MegabytesPerSecond(RunHttpLoad(options.nginx_port, paths, options.connections, options.seconds));
      const double http = MegabytesPerSecond(RunHttpLoad(port, paths, options.connections, options.seconds));
      const double grpc = MegabytesPerSecond(RunGrpcLoad(options));
      std::printf("%5.0f MB/s %7.0f MB/s %7.0f %% %7.0f MB/s %7.0f %%\n", nginx_rate, http, 100 * http / nginx_rate,
                  grpc, 100 * grpc / nginx_rate);
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
