#include "server/http/page_service.h"

#include <absl/strings/str_cat.h>

#include <filesystem>
#include <system_error>
#include <utility>

#include "server/http/asset_files.h"
#include "server/http/page_server.h"
#include "server/http/pages.h"
#include "server/log.h"
#include "server/work_pool.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<AssetFiles> ReadAssets(const std::string& directory) {
  if (!directory.empty()) {
    auto assets = AssetFiles::Read(directory);
    if (assets.ok()) return assets;
    return absl::Status(assets.status().code(), absl::StrCat("--http-assets: ", assets.status().message()));
  }
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  for (const char* place : {"../viewer", "../share/mapkeep/viewer"}) {
    const fs::path beside = (program.parent_path() / place).lexically_normal();
    if (!fs::exists(beside / "index.html", error)) continue;
    return AssetFiles::Read(beside.string());
  }
  LogWarning("viewer not found", {{"beside", program.string()}, {"setting", "http_assets"}});
  return AssetFiles();
}

}  // namespace

// In the order that the parts need each other; they go in the opposite one.
struct PageService::Parts {
  Parts(const Config& config, const PageSubjects& subjects, AssetFiles given)
      : assets(std::move(given)),
        tiles(subjects.maps, {.cache_bytes = static_cast<size_t>(config.pages.cache_mib) << 20,
                              .points = {.eta = config.stages.filter.eta}}),
        pool(std::make_unique<WorkPool>(config.pages.threads)),
        pages({subjects.maps, subjects.sessions, subjects.feed, subjects.epochs, tiles, assets, subjects.authority,
               *pool, config}) {}

  const AssetFiles assets;
  TileSource tiles;
  std::unique_ptr<WorkPool> pool;
  const Pages pages;
  std::unique_ptr<PageServer> server;
};

PageService::PageService(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

absl::StatusOr<std::unique_ptr<PageService>> PageService::Start(const Config& config, const PageSubjects& subjects) {
  auto assets = ReadAssets(config.pages.assets);
  if (!assets.ok()) return assets.status();
  auto parts = std::make_unique<Parts>(config, subjects, *std::move(assets));
  PageServerOptions options{.threads = config.pages.threads,
                            .connections = config.pages.connections,
                            .stall_seconds = config.pages.stall_seconds,
                            .cors_origins = config.pages.cors_origins,
                            .shared_caches = !subjects.authority.has_tokens()};
  if (const Certificates* certificates = subjects.certificates) {
    options.tls = [certificates](SSL_CTX* context) { certificates->Serve(context); };
  }
  auto server = PageServer::Start(config.http, options, [&pages = parts->pages](PageRequest request, Respond respond) {
    pages.Handle(std::move(request), std::move(respond));
  });
  if (!server.ok()) return server.status();
  parts->server = *std::move(server);
  return std::unique_ptr<PageService>(new PageService(std::move(parts)));
}

PageService::~PageService() {
  parts_->server->Stop(std::chrono::seconds(0));
  parts_->pool.reset();  // what it still answers goes nowhere, but needs the server
}

int PageService::port() const { return parts_->server->port(); }

TileSourceCounts PageService::tile_counts() const { return parts_->tiles.counts(); }

CacheUse PageService::tile_use() const { return parts_->tiles.encoded_use(); }

CacheUse PageService::point_use() const { return parts_->tiles.kept_use(); }

size_t PageService::connections() const { return parts_->server->connections(); }

uint64_t PageService::requests() const { return parts_->server->requests(); }

void PageService::Stop(std::chrono::seconds patience) { parts_->server->Stop(patience); }

}  // namespace mapkeep
