#include "server/daemon.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <shared_mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "server/housekeeping.h"
#include "server/http/admin_server.h"
#include "server/log.h"
#include "server/pipeline/pipeline.h"
#include "server/rpc/rpc_server.h"
#include "server/work_pool.h"
#include "storage/rados_engine.h"
#include "storage/rocksdb_engine.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

// Replaces the file in one step, so that nobody reads half of it.
absl::Status WriteFile(const fs::path& file, const std::string& text) {
  const fs::path temporary = absl::StrCat(file.string(), ".new");
  std::ofstream out(temporary, std::ios::trunc);
  out << text;
  out.close();
  std::error_code error;
  if (out) fs::rename(temporary, file, error);
  if (!out || error) return absl::UnavailableError(absl::StrCat("cannot write ", file.string()));
  return absl::OkStatus();
}

// This daemon's name on leases: made once for a data directory, so that a restart goes on with its own jobs at once.
absl::StatusOr<std::string> HolderName(const fs::path& data) {
  const fs::path file = data / "daemon_id";
  std::string name;
  if (std::ifstream in(file); in && std::getline(in, name) && !name.empty()) return name;
  std::random_device random;
  name = absl::StrFormat("daemon-%08x%08x", random(), random());
  if (absl::Status status = WriteFile(file, name + "\n"); !status.ok()) return status;
  return name;
}

}  // namespace

// In the order that the parts need each other; they go in the opposite one.
struct Daemon::State {
  Config config;
  std::unique_ptr<AdminServer> admin;
  std::unique_ptr<Engine> engine;
  std::unique_ptr<MapStore> maps;
  std::unique_ptr<SessionStore> sessions;
  std::unique_ptr<Leases> leases;
  SessionFeed feed;
  std::shared_mutex map_lifetimes;
  std::unique_ptr<Pipeline> pipeline;
  std::unique_ptr<WorkPool> pool;
  std::unique_ptr<RpcServer> rpc;
  std::unique_ptr<Housekeeping> housekeeping;
  bool stopped = false;

  absl::StatusOr<std::unique_ptr<Engine>> OpenEngine() const {
    const EngineConfig& given = config.engine;
    if (given.choice == EngineChoice::kRados) {
      return OpenRadosEngine({.conf = given.rados_conf,
                              .pool = given.rados_pool,
                              .name_space = given.rados_namespace,
                              .user = given.rados_user,
                              .keyring = given.rados_keyring});
    }
    auto opened = OpenRocksDbEngine((fs::path(config.data) / "rocksdb").string());
    if (opened.ok()) return opened;
    return absl::Status(opened.status().code(),
                        absl::StrFormat("--data %s: %s", config.data, opened.status().message()));
  }

  absl::Status OpenStores() {
    std::error_code error;
    fs::create_directories(config.data, error);
    if (error) return absl::UnavailableError(absl::StrFormat("--data %s: %s", config.data, error.message()));
    auto opened = OpenEngine();
    if (!opened.ok()) return opened.status();
    engine = *std::move(opened);
    maps = OpenMapStore(*engine, {.block_cache_bytes = static_cast<size_t>(config.limits.block_cache_mib) << 20});
    sessions = OpenSessionStore(*engine);
    leases = OpenLeases(*engine);
    return absl::OkStatus();
  }

  absl::Status StartServing() {
    const auto holder = HolderName(config.data);
    if (!holder.ok()) return holder.status();
    pipeline =
        std::make_unique<Pipeline>(PipelineStores{*maps, *sessions, *leases, feed},
                                   PipelineOptions{.threads = config.threads,
                                                   .jobs = config.limits.jobs,
                                                   .lease_seconds = static_cast<double>(config.limits.lease_seconds),
                                                   .holder = *holder,
                                                   .stages = config.stages});
    pool = std::make_unique<WorkPool>(config.limits.storage_threads);
    auto started =
        RpcServer::Start(config.listen, {*engine, *maps, *sessions, feed, *pipeline, *pool, config, map_lifetimes});
    if (!started.ok()) return started.status();
    rpc = *std::move(started);
    std::function<absl::Status()> take_over;
    if (config.engine.choice == EngineChoice::kRados) take_over = [this] { return pipeline->ResumeUnfinished(); };
    housekeeping = std::make_unique<Housekeeping>(*engine, *sessions, config.history, std::move(take_over),
                                                  config.limits.lease_seconds);
    return pipeline->ResumeUnfinished();
  }
};

Daemon::Daemon(std::unique_ptr<State> state) : state_(std::move(state)) {}

absl::StatusOr<std::unique_ptr<Daemon>> Daemon::Start(Config config) {
  auto state = std::make_unique<State>();
  state->config = std::move(config);
  // The admin listener first: a daemon that takes long to open its store is alive, though not ready.
  auto admin = AdminServer::Start(state->config.admin);
  if (!admin.ok()) return admin.status();
  state->admin = *std::move(admin);
  if (absl::Status status = state->OpenStores(); !status.ok()) return status;
  if (absl::Status status = state->StartServing(); !status.ok()) return status;

  std::unique_ptr<Daemon> daemon(new Daemon(std::move(state)));
  State& running = *daemon->state_;
  running.rpc->SetServing(true);
  running.admin->SetReady(true);
  if (!running.config.http.host.empty()) {
    LogWarning("http not served", {{"http", ToString(running.config.http)}, {"why", "not part of this version"}});
  }
  const std::string listen = ToString(daemon->listen()), admin_address = ToString(daemon->admin());
  if (!running.config.ports_file.empty()) {
    const nlohmann::json ports = {{"listen", listen}, {"admin", admin_address}};
    if (absl::Status status = WriteFile(running.config.ports_file, ports.dump() + "\n"); !status.ok()) return status;
  }
  LogInfo("serving", {{"listen", listen}, {"admin", admin_address}, {"data", running.config.data}});
  return daemon;
}

Daemon::~Daemon() { Stop(); }

void Daemon::Stop() {
  if (std::exchange(state_->stopped, true)) return;
  LogInfo("stopping");
  state_->admin->SetReady(false);
  state_->rpc->SetServing(false);
  std::this_thread::sleep_for(std::chrono::seconds(state_->config.limits.drain_seconds));
  state_->housekeeping.reset();
  state_->pipeline->Close();
  state_->rpc->Shutdown(std::chrono::seconds(state_->config.limits.shutdown_seconds));
  state_->rpc.reset();
  state_->pool.reset();
  state_->pipeline.reset();
  LogInfo("stopped");
}

Endpoint Daemon::listen() const { return {state_->config.listen.host, state_->rpc->port()}; }

Endpoint Daemon::admin() const { return {state_->config.admin.host, state_->admin->port()}; }

}  // namespace mapkeep
