#include "server/daemon.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>
#include <shared_mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "server/auth/authority.h"
#include "server/auth/certificates.h"
#include "server/background.h"
#include "server/credential_watch.h"
#include "server/epoch_feed.h"
#include "server/housekeeping.h"
#include "server/http/admin_server.h"
#include "server/http/page_service.h"
#include "server/log.h"
#include "server/metrics/call_metrics.h"
#include "server/metrics/metered_engine.h"
#include "server/metrics/metrics.h"
#include "server/metrics/pipeline_metrics.h"
#include "server/metrics/process_metrics.h"
#include "server/pipeline/pipeline.h"
#include "server/quota/quota_watch.h"
#include "server/quota/quotas.h"
#include "server/rpc/gate.h"
#include "server/rpc/rpc_server.h"
#include "server/scratch_directory.h"
#include "server/service_notice.h"
#include "server/spare_memory.h"
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

// How often watchers of sessions look whether another daemon has changed them.
constexpr std::chrono::seconds kLookElsewhere{2};

// What a replay left that a kill cut off.
void RemoveScratch(const fs::path& data) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(data, error)) {
    if (entry.path().filename().string().starts_with("replay-")) fs::remove_all(entry.path(), error);
  }
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
  std::unique_ptr<Authority> authority = std::make_unique<Authority>();
  std::unique_ptr<Certificates> certificates;  // nullptr: no TLS
  std::unique_ptr<CredentialWatch> credential_watch;
  Metrics metrics;
  CallMetrics call_metrics{metrics};
  std::unique_ptr<Quotas> quotas;
  PipelineEvents pipeline_events =
      CountedEvents(metrics, [this](const SessionRecord& session) { quotas->Note(session); });
  std::unique_ptr<AdminServer> admin;
  std::unique_ptr<Engine> engine;
  std::unique_ptr<MapStore> maps;
  std::unique_ptr<SessionStore> sessions;
  std::unique_ptr<Leases> leases;
  SessionFeed feed;
  std::unique_ptr<EpochFeed> epochs;
  std::unique_ptr<PlanCache> plans;
  std::shared_mutex map_lifetimes;
  std::unique_ptr<ScanMemory> scan_memory;
  std::unique_ptr<Pipeline> pipeline;
  std::unique_ptr<WorkPool> pool, staging;
  std::unique_ptr<Gate> gate;
  std::unique_ptr<RpcServer> rpc;
  std::unique_ptr<PageService> pages;  // nullptr: off
  std::unique_ptr<Housekeeping> housekeeping;
  std::unique_ptr<QuotaWatch> quota_watch;
  std::unique_ptr<SpareMemory> spare_memory;
  std::unique_ptr<ServiceNotice> notice;
  std::jthread look_elsewhere;  ///< for sessions that other daemons on the pool work on
  bool stopped = false;

  ~State() { metrics.ForgetSources(); }  // the admin listener still answers while the parts go

  absl::Status ReadCredentials() {
    const Security& security = config.security;
    if (!security.tokens.empty()) {
      auto opened = Authority::Open(security.tokens);
      if (!opened.ok()) return opened.status();
      authority = *std::move(opened);
    }
    if (!security.tls_cert.empty()) {
      auto opened = Certificates::Open(security.tls_cert, security.tls_key);
      if (!opened.ok()) return opened.status();
      certificates = *std::move(opened);
      if (!security.tls_client_ca.empty() && !std::ifstream(security.tls_client_ca)) {
        return absl::InvalidArgumentError(absl::StrCat("--tls-client-ca ", security.tls_client_ca, ": cannot be read"));
      }
    }
    gate = std::make_unique<Gate>(*authority);
    credential_watch = std::make_unique<CredentialWatch>(*authority, certificates.get());
    return absl::OkStatus();
  }

  void LookElsewhere(const std::stop_token& stop) {
    std::mutex mutex;
    std::condition_variable_any never;
    std::unique_lock lock(mutex);
    while (!never.wait_for(lock, stop, kLookElsewhere, [&stop] { return stop.stop_requested(); })) {
      feed.LookElsewhere();
    }
  }

  absl::StatusOr<std::unique_ptr<Engine>> OpenEngine() const {
    const EngineConfig& given = config.engine;
    if (given.choice == EngineChoice::kRados) {
      return OpenRadosEngine({.conf = given.rados_conf,
                              .pool = given.rados_pool,
                              .name_space = given.rados_namespace,
                              .user = given.rados_user,
                              .keyring = given.rados_keyring});
    }
    const auto bytes = [](int mib) { return static_cast<size_t>(mib) << 20; };
    auto opened = OpenRocksDbEngine((fs::path(config.data) / "rocksdb").string(),
                                    {.block_cache_bytes = bytes(given.rocksdb_block_cache_mib),
                                     .write_buffer_bytes = bytes(given.rocksdb_write_buffer_mib)});
    if (opened.ok()) {
      RemoveScratchDirectories(config.data);  // the store's lock says that nobody else is here
      return opened;
    }
    return absl::Status(opened.status().code(),
                        absl::StrFormat("--data %s: %s", config.data, opened.status().message()));
  }

  absl::Status OpenStores() {
    std::error_code error;
    fs::create_directories(config.data, error);
    if (error) return absl::UnavailableError(absl::StrFormat("--data %s: %s", config.data, error.message()));
    RemoveScratch(config.data);
    auto opened = OpenEngine();
    if (!opened.ok()) return opened.status();
    AddRocksDbMetrics(**opened);
    engine = Metered(*std::move(opened), metrics);
    maps = OpenMapStore(*engine, {.block_cache_bytes = static_cast<size_t>(config.limits.block_cache_mib) << 20});
    sessions = OpenSessionStore(*engine);
    leases = OpenLeases(*engine);
    return absl::OkStatus();
  }

  // `of` is what `engine` measures, and lives as long.
  void AddRocksDbMetrics(const Engine& of) {
    if (!MemoryOf(of)) return;
    const auto part = [&of](auto field) {
      return [&of, field] { return static_cast<double>(MemoryOf(of).value_or(RocksDbMemory()).*field); };
    };
    metrics.AddGauge("mapkeep_rocksdb_write_buffer_bytes", "Writes that RocksDB has in memory",
                     part(&RocksDbMemory::write_buffers));
    metrics.AddGauge("mapkeep_rocksdb_block_cache_bytes", "Blocks, indices and filters that RocksDB has in memory",
                     part(&RocksDbMemory::block_cache));
    metrics.AddGauge("mapkeep_rocksdb_table_reader_bytes", "What RocksDB holds for open files beside these, estimated",
                     part(&RocksDbMemory::table_readers));
  }

  void MakeQuotas() {
    const QuotaConfig& given = config.quota;
    const auto bytes = [](int mib) { return static_cast<int64_t>(mib) << 20; };
    quotas = std::make_unique<Quotas>(QuotaLimits{given.robot_sessions, given.robot_jobs, bytes(given.robot_mib)},
                                      QuotaLimits{given.map_sessions, given.map_jobs, bytes(given.map_mib)},
                                      std::chrono::seconds(given.retry_seconds),
                                      [this](const std::string& quota) { call_metrics.QuotaRefused(quota); });
    quota_watch = std::make_unique<QuotaWatch>(*engine, *sessions, *quotas);
  }

  absl::Status StartServing() {
    MakeQuotas();
    const auto holder = HolderName(config.data);
    if (!holder.ok()) return holder.status();
    scan_memory = std::make_unique<ScanMemory>(static_cast<size_t>(config.limits.scan_cache_mib) << 20);
    plans = std::make_unique<PlanCache>(static_cast<size_t>(config.limits.plan_cache_mib) << 20);
    pipeline = std::make_unique<Pipeline>(
        PipelineStores{*maps, *sessions, *leases, feed, *plans, &pipeline_events, scan_memory.get()},
        PipelineOptions{.threads = config.threads,
                        .jobs = config.limits.jobs,
                        .serial_per_map = config.serial_per_map,
                        .lease_seconds = static_cast<double>(config.limits.lease_seconds),
                        .holder = *holder,
                        .stages = config.stages});
    // gRPC's threads and the pages' are started from this one, too.
    MoveBytes();
    pool = std::make_unique<WorkPool>(config.limits.storage_threads);
    staging = std::make_unique<WorkPool>(config.limits.storage_threads, true);
    epochs = std::make_unique<EpochFeed>(*maps);
    auto started = RpcServer::Start(config.listen, {*engine, *maps, *sessions, feed, *pipeline, *plans, *pool, *staging,
                                                    config, *gate, call_metrics, *quotas, map_lifetimes, *epochs});
    if (!started.ok()) return started.status();
    rpc = *std::move(started);
    if (!config.http.host.empty()) {
      auto served = PageService::Start(config, {*maps, *sessions, feed, *epochs, *authority, certificates.get()});
      if (!served.ok()) return served.status();
      pages = *std::move(served);
    }
    std::function<absl::Status()> take_over;
    if (config.engine.choice == EngineChoice::kRados) take_over = [this] { return pipeline->ResumeUnfinished(); };
    if (config.engine.choice == EngineChoice::kRados) {
      look_elsewhere = std::jthread([this](const std::stop_token& stop) { LookElsewhere(stop); });
    }
    housekeeping = std::make_unique<Housekeeping>(*engine, *sessions, config.history, std::move(take_over),
                                                  config.limits.lease_seconds);
    spare_memory = std::make_unique<SpareMemory>(
        [this] { return rpc->uploads() > 0 || pipeline->Status().at_work > 0 || pipeline->Status().waiting > 0; });
    AddMetrics();
    return pipeline->ResumeUnfinished();
  }

  // What the parts can be asked at any time.
  void AddMetrics() {
    const auto jobs = [this](auto field) {
      return [this, field] { return static_cast<double>(pipeline->Status().*field); };
    };
    metrics.AddGauge("mapkeep_jobs_waiting", "Sessions that wait for a worker", jobs(&JobQueueStatus::waiting));
    metrics.AddGauge("mapkeep_jobs_running", "Sessions at work", jobs(&JobQueueStatus::at_work));
    metrics.AddGauge("mapkeep_job_oldest_seconds", "How long the session that waits longest has waited",
                     jobs(&JobQueueStatus::oldest_seconds));
    const auto work = [this](auto field) {
      return [this, field] { return static_cast<double>(pool->Status().*field); };
    };
    metrics.AddGauge("mapkeep_pool_waiting", "Tasks of calls that wait for a storage thread",
                     work(&WorkPoolStatus::waiting));
    metrics.AddGauge("mapkeep_pool_running", "Storage threads at work", work(&WorkPoolStatus::at_work));
    metrics.AddGauge("mapkeep_pool_oldest_seconds", "How long the next task has waited for a storage thread",
                     work(&WorkPoolStatus::oldest_seconds));
    metrics.AddCount("mapkeep_pool_tasks_total", "Tasks of calls that storage threads have done",
                     work(&WorkPoolStatus::done));
    metrics.AddGauge("mapkeep_staging_waiting", "Batches of scans that wait for a thread to stage them",
                     [this] { return static_cast<double>(staging->Status().waiting); });
    metrics.AddGauge("mapkeep_staging_running", "Batches of scans that are being staged",
                     [this] { return static_cast<double>(staging->Status().at_work); });
    metrics.AddGauge("mapkeep_uploads_open", "Uploads under way",
                     [this] { return static_cast<double>(rpc->uploads()); });
    std::vector<std::pair<const char*, std::function<CacheUse()>>> caches = {
        {"blocks", [this] { return maps->Caches().blocks; }},
        {"nodes", [this] { return maps->Caches().nodes; }},
        {"tiles", [this] { return rpc->tile_cache(); }}};
    if (pages != nullptr) {
      caches.emplace_back("http_tiles", [this] { return pages->tile_use(); });
      caches.emplace_back("http_points", [this] { return pages->point_use(); });
    }
    for (const auto& [name, of] : caches) {
      const prometheus::Labels labels = {{"cache", name}};
      metrics.AddCount(
          "mapkeep_cache_hits_total", "Reads that a cache answered", [of] { return static_cast<double>(of().hits); },
          labels);
      metrics.AddCount(
          "mapkeep_cache_misses_total", "Reads that went past a cache to the engine",
          [of] { return static_cast<double>(of().misses); }, labels);
      metrics.AddGauge(
          "mapkeep_cache_bytes", "Bytes that a cache holds", [of] { return static_cast<double>(of().bytes); }, labels);
    }
    metrics.AddGauge("mapkeep_scan_cache_bytes", "Bytes of decoded scans that sessions at work keep",
                     [this] { return static_cast<double>(scan_memory->used()); });
    metrics.AddGauge("mapkeep_plan_cache_bytes", "Bytes of plans of tiles that alignment keeps",
                     [this] { return static_cast<double>(plans->bytes()); });
    metrics.AddCount("mapkeep_plans_made_total", "Plans of tiles that were made, found neither in memory nor stored",
                     [this] { return static_cast<double>(plans->made()); });
    metrics.AddCount("mapkeep_plans_not_stored_total", "Those of them that could not be stored beside their tile",
                     [this] { return static_cast<double>(plans->not_stored()); });
    const auto use = [this](auto field) {
      return [this, field] { return static_cast<double>(quotas->Total().*field); };
    };
    metrics.AddGauge("mapkeep_quota_sessions", "Sessions that are begun and not committed",
                     use(&Quotas::Use::sessions));
    metrics.AddGauge("mapkeep_quota_jobs", "Sessions that are committed and not at their end", use(&Quotas::Use::jobs));
    metrics.AddGauge("mapkeep_quota_bytes", "Bytes of the scans of both", use(&Quotas::Use::bytes));
    if (pages != nullptr) {
      metrics.AddGauge("mapkeep_http_connections", "Open connections to pages and tiles",
                       [this] { return static_cast<double>(pages->connections()); });
      metrics.AddCount("mapkeep_http_requests_total", "Requests for pages and tiles",
                       [this] { return static_cast<double>(pages->requests()); });
      metrics.AddCount("mapkeep_http_tiles_made_total", "Tiles that no cache had",
                       [this] { return static_cast<double>(pages->tile_counts().tiles); });
    }
    metrics.AddGauge("mapkeep_ready", "1 while the daemon takes work", [this] { return admin->ready() ? 1 : 0; });
    if (certificates != nullptr) {
      metrics.AddGauge("mapkeep_certificate_expiry_seconds", "When the certificate expires, seconds since 1970 (UTC)",
                       [this] { return certificates->expiry(); });
    }
    AddProcessMetrics(metrics);
  }
};

Daemon::Daemon(std::unique_ptr<State> state) : state_(std::move(state)) {}

absl::StatusOr<std::unique_ptr<Daemon>> Daemon::Start(Config config) {
  auto state = std::make_unique<State>();
  state->config = std::move(config);
  // The admin listener before the store: a daemon that takes long to open its store is alive, though not ready.
  if (absl::Status status = state->ReadCredentials(); !status.ok()) return status;
  auto admin = AdminServer::Start(state->config.admin, {*state->authority, state->certificates.get(),
                                                        [of = state.get()] { return of->metrics.Text(); }});
  if (!admin.ok()) return admin.status();
  state->admin = *std::move(admin);
  if (absl::Status status = state->OpenStores(); !status.ok()) return status;
  if (absl::Status status = state->StartServing(); !status.ok()) return status;

  std::unique_ptr<Daemon> daemon(new Daemon(std::move(state)));
  State& running = *daemon->state_;
  running.rpc->SetServing(true);
  running.admin->SetReady(true);
  const std::string listen = ToString(daemon->listen()), admin_address = ToString(daemon->admin()),
                    http = ToString(daemon->http());
  if (!running.config.ports_file.empty()) {
    nlohmann::json ports = {{"listen", listen}, {"admin", admin_address}};
    if (running.pages) ports["http"] = http;
    if (absl::Status status = WriteFile(running.config.ports_file, ports.dump() + "\n"); !status.ok()) return status;
  }
  LogInfo("serving", {{"listen", listen}, {"admin", admin_address}, {"http", http}, {"data", running.config.data}});
  // Takes every lock that the parts share: one that is held for ever ends in a restart by systemd.
  running.notice = std::make_unique<ServiceNotice>([&running] {
    running.pipeline->Status();
    running.pool->Status();
    running.rpc->uploads();
    running.metrics.Text();
    return true;
  });
  return daemon;
}

Daemon::~Daemon() { Stop(); }

void Daemon::Stop() {
  if (std::exchange(state_->stopped, true)) return;
  LogInfo("stopping");
  if (state_->notice != nullptr) state_->notice->Stopping();
  state_->admin->SetReady(false);
  state_->rpc->SetServing(false);
  std::this_thread::sleep_for(std::chrono::seconds(state_->config.limits.drain_seconds));
  state_->housekeeping.reset();
  state_->quota_watch.reset();
  state_->spare_memory.reset();
  state_->look_elsewhere = {};
  state_->pipeline->Close();
  const std::chrono::seconds patience(state_->config.limits.shutdown_seconds);
  state_->feed.Close();
  state_->epochs->Close();
  std::thread pages_end([this, patience] {
    if (state_->pages) state_->pages->Stop(patience);
  });
  state_->rpc->Shutdown(patience);
  pages_end.join();
  state_->metrics.ForgetSources();
  state_->pages.reset();
  state_->rpc.reset();
  state_->epochs.reset();
  state_->pool.reset();
  state_->staging.reset();
  state_->pipeline.reset();
  LogInfo("stopped");
}

Endpoint Daemon::listen() const { return {state_->config.listen.host, state_->rpc->port()}; }

Endpoint Daemon::http() const {
  return state_->pages ? Endpoint{state_->config.http.host, state_->pages->port()} : Endpoint{};
}

Endpoint Daemon::admin() const { return {state_->config.admin.host, state_->admin->port()}; }

}  // namespace mapkeep
