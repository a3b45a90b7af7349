// What a daemon bears: robots that only stay connected, scans made durable, tiles read meanwhile. Starts a mapkeepd of
// its own on a temporary directory (TMPDIR says where) and prints one line a figure. Tiles are read by a process of its
// own that wakes as soon as the daemon's threads do, and the robots give way to it and to the daemon: the work of both
// is not on the daemon's machine in a fleet.

#include <fcntl.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/background.h"
#include "storage/pause.h"
#include "tests/integration/any_call.h"
#include "tests/integration/daemon_process.h"
#include "tests/integration/http_status.h"
#include "tests/integration/robot.h"

namespace mapkeep {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kMegabyte = 1e6;
constexpr int kPoints = 120'000;
constexpr size_t kChunk = size_t{1} << 20;

struct Options {
  int idle = 2000;
  int megabytes = 2000;
  int robots = 2;
  int rounds = 1;
  std::vector<std::string> flags;
};

double SecondsSince(Clock::time_point began) { return std::chrono::duration<double>(Clock::now() - began).count(); }

// A value that the daemon shows, by its name with labels.
double Metric(const DaemonProcess& daemon, const std::string& name) {
  const std::string text = HttpGet(daemon.admin(), "/metrics").body;
  const std::string line = "\n" + name + " ";
  const size_t at = text.find(line);
  return at == std::string::npos ? 0 : std::strtod(text.c_str() + at + line.size(), nullptr);
}

double ResidentBytes(const DaemonProcess& daemon) { return Metric(daemon, "mapkeep_process_resident_bytes"); }

// Of the daemon's calls of a method, how many in a hundred it ended within so long of seeing them begin: a reader waits
// besides for the daemon to see its call, and for a processor of his own. `seconds`: a bound of the histogram.
double PercentWithin(const DaemonProcess& daemon, const std::string& method, const char* seconds) {
  const std::string labels = "{method=\"/mapkeep.v1.TileService/" + method + "\"";
  return 100 * Metric(daemon, "mapkeep_call_seconds_bucket" + labels + ",le=\"" + seconds + "\"}") /
         Metric(daemon, "mapkeep_call_seconds_count" + labels + "}");
}

void Check(const grpc::Status& status, const char* what) {
  if (status.ok()) return;
  std::fprintf(stderr, "%s: %d %s\n", what, status.error_code(), status.error_message().c_str());
  std::exit(1);
}

// Robots that only stay connected, each with a connection of its own and a stream that waits for news of a session.
class IdleRobots {
 public:
  IdleRobots(const DaemonProcess& daemon, int robots) {
    Robot robot(daemon.listen());
    Check(robot.CreateMap("idle"), "CreateMap");
    const WireScan scan = Wire(0, DriveAlong(Street(), 1, 1.7e9).scans[0], Pose::Identity());
    Check(robot.Begin("idle", "waiting", {scan}), "BeginSession");
    const double before = ResidentBytes(daemon);
    v1::WatchSessionRequest request;
    request.set_map("idle");
    request.set_id("waiting");
    for (int i = 0; i < robots; ++i) {
      stubs_.push_back(v1::SessionService::NewStub(ChannelTo(daemon.listen())));
      calls_.push_back(std::make_unique<grpc::ClientContext>());
      watches_.push_back(stubs_.back()->WatchSession(calls_.back().get(), request));
      v1::WatchSessionResponse now;
      if (!watches_.back()->Read(&now)) Check(watches_.back()->Finish(), "WatchSession");
    }
    const double mebibytes = (ResidentBytes(daemon) - before) / (1 << 20);
    std::printf("idle: %d robots, each connected and watching: %.0f MiB more, %.1f KiB a robot\n", robots, mebibytes,
                mebibytes * 1024 / robots);
  }

  ~IdleRobots() {
    for (auto& call : calls_) call->TryCancel();
    for (auto& watch : watches_) watch->Finish();
  }

 private:
  std::vector<std::unique_ptr<v1::SessionService::Stub>> stubs_;
  std::vector<std::unique_ptr<grpc::ClientContext>> calls_;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::WatchSessionResponse>>> watches_;
};

// A scan like a lidar's: smooth ranges with noise in the low bits, so that it compresses as real ones do.
WireScan LidarScan(uint32_t index) {
  Scan scan;
  scan.points.reserve(kPoints);
  uint32_t noise = index + 1;
  for (int i = 0; i < kPoints; ++i) {
    noise = noise * 1664525 + 1013904223;
    const double azimuth = i % 1875 * 0.00335, elevation = (i / 1875 - 32) * 0.007;
    const double range = 12 + 8 * std::sin(3 * azimuth) + static_cast<double>(noise >> 16) * 5e-7;
    scan.points.emplace_back(static_cast<float>(range * std::cos(azimuth)),
                             static_cast<float>(range * std::sin(azimuth)), static_cast<float>(range * elevation));
    scan.intensities.push_back(static_cast<float>(noise >> 24) / 255.0F);
  }
  scan.time = 1.7e9 + index * 0.1;
  return Wire(index, scan, Pose::Identity());
}

// The messages of a scan but for its header, ready to be sent: what a robot does with its points is not on the daemon's
// machine. `scan` outlives them.
std::vector<grpc::ByteBuffer> Chunks(const WireScan& scan) {
  std::vector<grpc::ByteBuffer> messages;
  for (size_t at = 0; at < scan.bytes.size(); at += kChunk) {
    const size_t size = std::min(kChunk, scan.bytes.size() - at);
    std::string before(1, static_cast<char>(v1::UploadScansRequest::kChunkFieldNumber << 3 | 2));
    for (size_t rest = size; rest > 0; rest >>= 7) {
      before.push_back(static_cast<char>((rest & 0x7F) | (rest >= 0x80 ? 0x80 : 0)));
    }
    const std::array<grpc::Slice, 2> slices = {grpc::Slice(before),
                                               grpc::Slice(scan.bytes.data() + at, size, grpc::Slice::STATIC_SLICE)};
    messages.emplace_back(slices.data(), slices.size());
  }
  return messages;
}

grpc::ByteBuffer BufferOf(const v1::UploadScansRequest& message) {
  const grpc::Slice slice(message.SerializeAsString());
  return {&slice, 1};
}

// An upload by messages that are bytes already, in the calling thread.
class RawUpload {
 public:
  explicit RawUpload(Robot& robot) : stub_(robot.channel()), context_(Robot::Call()) {
    context_->set_deadline(std::chrono::system_clock::now() + std::chrono::minutes(10));
    call_ = stub_.PrepareCall(context_.get(), "/mapkeep.v1.SessionService/UploadScans", &queue_);
    call_->StartCall(&written_);
    AwaitWrite();
    call_->Read(&answer_, &read_);
  }

  // False once the stream is broken.
  bool Write(const grpc::ByteBuffer& message) {
    call_->Write(message, &written_);
    return AwaitWrite();
  }

  grpc::Status End() {
    call_->WritesDone(&written_);
    AwaitWrite();
    while (reading_) Next();
    grpc::Status status;
    call_->Finish(&status, &written_);
    AwaitWrite();
    return status;
  }

 private:
  bool AwaitWrite() {
    writing_ = true;
    while (writing_) Next();
    return alive_;
  }

  void Next() {
    void* tag = nullptr;
    bool ok = false;
    if (!queue_.Next(&tag, &ok)) std::abort();
    if (tag == &written_) {
      writing_ = false;
      alive_ = ok;
    } else if (ok) {
      call_->Read(&answer_, &read_);
    } else {
      reading_ = false;
    }
  }

  grpc::GenericStub stub_;
  grpc::CompletionQueue queue_;
  std::unique_ptr<grpc::ClientContext> context_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
  grpc::ByteBuffer answer_;
  bool writing_ = false, reading_ = true, alive_ = true;
  char written_ = 0, read_ = 0;  // their addresses are the tags
};

// Sends the same few scans over and over as one session, and waits until all are durable.
void Upload(const std::string& address, const std::string& id, const std::vector<WireScan>& kinds, int count) {
  Robot robot(address);
  v1::BeginSessionRequest begin;
  begin.set_map("site");
  begin.set_id(id);
  for (int i = 0; i < count; ++i) begin.add_scan_crc32c(kinds[i % kinds.size()].header.crc32c());
  v1::BeginSessionResponse begun;
  Check(robot.sessions().BeginSession(Robot::Call().get(), begin, &begun), "BeginSession");
  std::vector<std::vector<grpc::ByteBuffer>> chunks;
  for (const WireScan& kind : kinds) chunks.push_back(Chunks(kind));
  RawUpload upload(robot);
  v1::UploadScansRequest message;
  message.mutable_open()->set_map("site");
  message.mutable_open()->set_id(id);
  bool alive = upload.Write(BufferOf(message));
  for (int i = 0; alive && i < count; ++i) {
    const size_t kind = static_cast<size_t>(i) % kinds.size();
    *message.mutable_scan() = kinds[kind].header;
    message.mutable_scan()->set_index(static_cast<uint32_t>(i));
    alive = upload.Write(BufferOf(message));
    for (size_t k = 0; alive && k < chunks[kind].size(); ++k) {
      alive = upload.Write(chunks[kind][k]);
      LetOthersRun();
    }
  }
  Check(upload.End(), "UploadScans");
}

// How a tile is read: as robots do it, or block by block with all that the map has of it.
template <typename Response>
double SecondsOfRead(const std::function<std::unique_ptr<grpc::ClientReader<Response>>(grpc::ClientContext*)>& start,
                     int least) {
  const auto began = Clock::now();
  const auto call = Robot::Call();
  const auto stream = start(call.get());
  Response response;
  int messages = 0;
  while (stream->Read(&response)) ++messages;
  Check(stream->Finish(), "a read of a tile");
  if (messages < least) Check(grpc::Status(grpc::StatusCode::NOT_FOUND, "the tile is not there"), "a read of a tile");
  return SecondsSince(began);
}

// Reads one tile over and over until standard input ends, both ways in turns, and writes the seconds of each read to
// standard output: pairs.
void ReadTiles(const std::string& address) {
  std::atomic<bool> done = false;
  std::thread waiting([&done] {
    while (std::getchar() != EOF) continue;
    done = true;
  });
  AnswerSoon();
  Robot robot(address);
  v1::GetTilesRequest tile;
  tile.set_map("tiles");
  tile.add_ids();
  v1::StreamTilesRequest blocks;
  blocks.set_map("tiles");
  blocks.mutable_box()->mutable_min()->set_x(0);
  blocks.mutable_box()->mutable_min()->set_y(-6);
  blocks.mutable_box()->mutable_min()->set_z(-5);
  blocks.mutable_box()->mutable_max()->set_x(12);
  blocks.mutable_box()->mutable_max()->set_y(6);
  blocks.mutable_box()->mutable_max()->set_z(5);
  std::vector<double> seconds;
  while (!done) {
    seconds.push_back(SecondsOfRead<v1::GetTilesResponse>(
        [&](grpc::ClientContext* call) { return robot.tiles().GetTiles(call, tile); }, 2));
    seconds.push_back(SecondsOfRead<v1::StreamTilesResponse>(
        [&](grpc::ClientContext* call) { return robot.tiles().StreamTiles(call, blocks); }, 2));
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  waiting.join();
  for (const double one : seconds) std::printf("%.9f\n", one);
}

// This program as a reader of tiles.
class TileReader {
 public:
  explicit TileReader(const std::string& address) {
    std::array<int, 2> to{}, from{};
    if (pipe2(to.data(), O_CLOEXEC) != 0 || pipe2(from.data(), O_CLOEXEC) != 0) std::abort();
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, to[0], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, from[1], STDOUT_FILENO);
    std::string program = "/proc/self/exe", flag = "--read-tiles", where = address;
    std::array<char*, 4> words = {program.data(), flag.data(), where.data(), nullptr};
    if (posix_spawn(&process_, program.c_str(), &actions, nullptr, words.data(), environ) != 0) std::abort();
    posix_spawn_file_actions_destroy(&actions);
    close(to[0]);
    close(from[1]);
    to_ = to[1];
    from_ = from[0];
  }

  /// Ends it; the seconds of each read.
  std::vector<double> End() {
    close(to_);
    std::vector<double> seconds;
    std::FILE* const lines = fdopen(from_, "r");
    for (double one = 0; std::fscanf(lines, "%lf", &one) == 1;) seconds.push_back(one);
    std::fclose(lines);
    waitpid(process_, nullptr, 0);
    return seconds;
  }

 private:
  pid_t process_ = -1;
  int to_ = -1, from_ = -1;
};

// The same bytes by dd, a scan a write, each durable before the next. MB/s.
double DdRate(const std::string& directory, int scans) {
  const std::string file = directory + "/dd";
  const std::string command = "dd if=/dev/zero of=" + file + " bs=" + std::to_string(16 * kPoints) +
                              " count=" + std::to_string(scans) + " oflag=dsync 2>/dev/null";
  const auto began = Clock::now();
  if (std::system(command.c_str()) != 0) return 0;
  const double seconds = SecondsSince(began);
  std::remove(file.c_str());
  return 16.0 * kPoints * scans / kMegabyte / seconds;
}

// Uploads as many sessions at a time as there are robots; the seconds of each tile's read meanwhile.
std::vector<double> MeasureRound(const DaemonProcess& daemon, const Options& options,
                                 const std::vector<WireScan>& kinds, int round) {
  const int scans = static_cast<int>(options.megabytes * kMegabyte / (16.0 * kPoints) / options.robots);
  const TemporaryDirectory beside;
  const double dd_before = DdRate(beside.path(), scans * options.robots);

  TileReader reader(daemon.listen());
  const auto began = Clock::now();
  std::vector<std::thread> robots;
  for (int i = 0; i < options.robots; ++i) {
    robots.emplace_back([&, i] {
      GiveWay();
      Upload(daemon.listen(), "u" + std::to_string(round) + "-" + std::to_string(i), kinds, scans);
    });
  }
  for (std::thread& one : robots) one.join();
  const double seconds = SecondsSince(began);
  std::vector<double> reads = reader.End();
  const double dd_after = DdRate(beside.path(), scans * options.robots);

  const double rate = 16.0 * kPoints * scans * options.robots / kMegabyte / seconds, dd = (dd_before + dd_after) / 2;
  std::printf(
      "upload: %d robots, %.0f MB of raw scans in %.1f s: %.0f MB/s durable; dd oflag=dsync before %.0f, after %.0f "
      "MB/s: %.0f %%\n",
      options.robots, rate * seconds, seconds, rate, dd_before, dd_after, 100 * rate / dd);
  std::fflush(stdout);
  return reads;
}

void MeasureUploads(const DaemonProcess& daemon, const Options& options) {
  Robot robot(daemon.listen());
  Check(robot.CreateMap("site"), "CreateMap");
  Check(robot.CreateMap("tiles"), "CreateMap");
  Check(robot.UploadDrive("tiles", "s", DriveAlong(Street(), 12, 1.7e9)), "UploadDrive");
  robot.Watch("tiles", "s");
  std::vector<WireScan> kinds;
  for (uint32_t i = 0; i < 8; ++i) kinds.push_back(LidarScan(i));
  std::vector<double> reads;
  for (int round = 0; round < options.rounds; ++round) {
    const std::vector<double> more = MeasureRound(daemon, options, kinds, round);
    reads.insert(reads.end(), more.begin(), more.end());
  }
  if (reads.empty()) {
    std::fprintf(stderr, "no tile was read\n");
    std::exit(1);
  }
  for (const size_t kind : {0, 1}) {
    std::vector<double> sorted;
    for (size_t i = kind; i < reads.size(); i += 2) sorted.push_back(reads[i]);
    std::sort(sorted.begin(), sorted.end());
    const auto at = [&](double share) {
      return 1000 * sorted[static_cast<size_t>(share * static_cast<double>(sorted.size() - 1))];
    };
    const char* const method = kind == 0 ? "GetTiles" : "StreamTiles";
    std::printf(
        "%s (%s) meanwhile: %zu reads, median %.2f ms, p99 %.2f ms, longest %.2f ms; in the daemon alone %.1f %% "
        "within 2 ms, %.1f %% within 5 ms\n",
        kind == 0 ? "a tile" : "its blocks", method, sorted.size(), at(0.5), at(0.99), at(1),
        PercentWithin(daemon, method, "0.002"), PercentWithin(daemon, method, "0.005"));
  }
  std::printf("memory afterwards: %.0f MiB\n", ResidentBytes(daemon) / (1 << 20));
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) {
  mapkeep::Options options;
  CLI::App app("What a daemon bears: idle robots, uploads, tiles meanwhile.");
  app.add_option("--idle", options.idle, "Robots that stay connected and watch all the while; 0: none")
      ->capture_default_str();
  app.add_option("--megabytes", options.megabytes, "Raw scans to upload; 0: not measured")->capture_default_str();
  app.add_option("--robots", options.robots, "That upload at a time")->capture_default_str();
  app.add_option("--rounds", options.rounds, "Times that they do; tiles' reads are pooled")->capture_default_str();
  app.add_option("--daemon-flag", options.flags, "Passed on to mapkeepd, a word each");
  std::string read_tiles;
  app.add_option("--read-tiles", read_tiles, "HOST:PORT: only read a tile there until standard input ends");
  CLI11_PARSE(app, argc, argv);
  if (!read_tiles.empty()) {
    mapkeep::ReadTiles(read_tiles);
    return 0;
  }
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);
  const mapkeep::DaemonProcess daemon(options.flags);
  std::optional<mapkeep::IdleRobots> idle;  // as long as the daemon is measured
  if (options.idle > 0) idle.emplace(daemon, options.idle);
  if (options.megabytes > 0) mapkeep::MeasureUploads(daemon, options);
  return 0;
}
