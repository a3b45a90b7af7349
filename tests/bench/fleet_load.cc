// fleet_load: a fleet of simulated robots uploads sessions of one street to a daemon (or to a balancer before several)
// while readers stream the map. Prints one JSON document: every session with its end, what went wrong, how much went
// over the wire. Exit status 1 if a session did not end committed or a reader saw an error or an epoch that went back.
#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "client/mapkeep/client.h"
#include "client/mapkeep/scan_checksums.h"
#include "client/simulator/street_session.h"

namespace mapkeep {
namespace {

struct Arguments {
  ClientOptions server;
  std::string robot_tokens;
  std::string map = "fleet", prefix = "robot", sensor = "os1-64";
  int robots = 40, sessions = 1, readers = 2;
  size_t scans = 20, every_nth_point = 1;
  uint64_t seed = 1;
  double route = 15;  // metres over which the robots' starts are spread
  bool keep_scans = false;
};

// What all threads report into.
struct Outcome {
  std::mutex mutex;
  nlohmann::json sessions = nlohmann::json::array(), errors = nlohmann::json::array();
  std::atomic<uint64_t> bytes = 0, streams = 0;
  std::atomic<bool> uploads_ended = false;

  void Error(const std::string& who, const absl::Status& status) {
    const std::lock_guard lock(mutex);
    errors.push_back({{"who", who}, {"error", status.ToString()}});
  }
};

// How robot `robot` connects.
ClientOptions OptionsOf(const Arguments& arguments, int robot) {
  ClientOptions options = arguments.server;
  if (arguments.robot_tokens.empty()) return options;
  std::ifstream lines(arguments.robot_tokens);
  for (int line = 0; line <= robot; ++line) std::getline(lines, options.token);
  return options;
}

double SecondsSince(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// Holds the scans, thinned: a robot has them in memory, and casting is not what is measured.
absl::StatusOr<std::vector<Scan>> ScansOf(const SimulatedSession& session, size_t every_nth) {
  std::vector<Scan> scans;
  for (size_t i = 0; i < session.scans.count; ++i) {
    auto scan = session.scans.read(i);
    if (!scan.ok()) return scan.status();
    Scan thinned{.time = scan->time};
    for (size_t p = 0; p < scan->points.size(); p += every_nth) {
      thinned.points.push_back(scan->points[p]);
      if (!scan->intensities.empty()) thinned.intensities.push_back(scan->intensities[p]);
    }
    scans.push_back(std::move(thinned));
  }
  return scans;
}

// Tries again what UNAVAILABLE says may be tried again, as a robot would, for as long as it has patience.
template <typename Call>
auto Patiently(const Arguments& arguments, const Call& call) {
  const auto begin = std::chrono::steady_clock::now();
  auto result = call();
  while (absl::IsUnavailable(result.status()) && SecondsSince(begin) < arguments.server.patience_seconds) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    result = call();
  }
  return result;
}

// One session of one robot, to its end. The founder drives four times as far with all of its points, so that the others
// find a map that covers where they begin.
absl::Status Drive(const Arguments& arguments, const Client& client, const Street& street, int robot, int number,
                   Outcome& outcome) {
  const bool founder = robot == 0 && number == 0;
  const auto sensor = SensorNamed(arguments.sensor);
  if (!sensor.ok()) return sensor.status();
  DriveParameters drive{.sensor = *sensor, .scans = arguments.scans * (founder ? 4 : 1)};
  drive.start = arguments.route * robot / std::max(1, arguments.robots);
  const auto session = DriveThrough(street, number, drive);
  if (!session.ok()) return session.status();
  const auto scans = ScansOf(*session, founder ? 1 : arguments.every_nth_point);
  if (!scans.ok()) return scans.status();
  uint64_t bytes = 0;
  for (const Scan& scan : *scans) bytes += 16 * scan.points.size();

  const std::string name = arguments.prefix + "-" + std::to_string(robot);
  const std::string id = name + "-day-" + std::to_string(number + 1);
  const ScanSource source = SourceOf(*scans);
  // The robots know where they are (the street's frame), so that the load is the service's and not the search's.
  const auto checksums = ScanChecksums(source, session->truth);
  if (!checksums.ok()) return checksums.status();
  const auto begin = std::chrono::steady_clock::now();
  const auto uploaded = Patiently(arguments, [&] {
    return client.UploadSession({.map = arguments.map,
                                 .id = id,
                                 .robot = name,
                                 .keep_scans = arguments.keep_scans,
                                 .scans = source,
                                 .poses = session->truth,
                                 .checksums = *checksums});
  });
  if (!uploaded.ok()) return uploaded.status();
  const double acknowledged = SecondsSince(begin);
  outcome.bytes += bytes;
  const auto ended = Patiently(
      arguments, [&] { return client.WatchSession(arguments.map, id, [](const SessionInfo&) { return true; }); });
  if (!ended.ok()) return ended.status();
  const bool committed = ended->state == SessionInfo::State::kCommitted;
  const std::lock_guard lock(outcome.mutex);
  outcome.sessions.push_back({{"id", id},
                              {"committed", committed},
                              {"reason", ended->reason},
                              {"epoch", ended->report ? ended->report->epoch : 0},
                              {"acknowledged_s", acknowledged},
                              {"ended_s", SecondsSince(begin)}});
  if (!committed) return absl::FailedPreconditionError(id + " was not committed: " + ended->reason);
  return absl::OkStatus();
}

// Streams the map over and over, as a robot that follows it would; what it sees is one epoch, never an older one.
void Follow(const Arguments& arguments, int reader, Outcome& outcome) {
  const Client client(arguments.server);
  const std::string who = "reader " + std::to_string(reader);
  uint64_t newest = 0;
  while (!outcome.uploads_ended) {
    uint64_t epoch = 0;
    const absl::Status status = client.StreamBlocks(
        {.map = arguments.map},
        [&](const MapSnapshot& snapshot) {
          epoch = snapshot.epoch;
          return absl::OkStatus();
        },
        [](const Block&) { return absl::OkStatus(); });
    if (status.ok()) {
      ++outcome.streams;
      if (epoch < newest) outcome.Error(who, absl::DataLossError("the map went back to an older epoch"));
      newest = std::max(newest, epoch);
    } else if (!absl::IsUnavailable(status)) {  // UNAVAILABLE is what a client tries again
      outcome.Error(who, status);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
}

int Run(int argc, char** argv) {
  CLI::App app("Uploads simulated sessions from many robots at once while readers follow the map");
  Arguments a;
  a.server.patience_seconds = 180;
  app.add_option("--server", a.server.server, "HOST:PORT")->required();
  app.add_option("--tls-ca", a.server.tls_ca, "PEM of the authorities");
  app.add_option("--token", a.server.token, "of who makes the map and reads it");
  app.add_option("--robot-tokens", a.robot_tokens, "file with a token a line, robot by robot; nothing: --token for all")
      ->check(CLI::ExistingFile);
  app.add_option("--map", a.map, "made if it is not there");
  app.add_option("--prefix", a.prefix, "of the robots' names");
  app.add_option("--robots", a.robots);
  app.add_option("--sessions", a.sessions, "of each robot");
  app.add_option("--scans", a.scans, "of each session");
  app.add_option("--every-nth-point", a.every_nth_point)->check(CLI::Range(1, 1000));
  app.add_option("--readers", a.readers);
  app.add_option("--route", a.route, "metres of street over which the robots' starts are spread");
  app.add_option("--sensor", a.sensor)->check(CLI::IsMember(SensorNames()));
  app.add_option("--seed", a.seed, "of the street");
  app.add_flag("--keep-scans", a.keep_scans);
  CLI11_PARSE(app, argc, argv);

  const auto street = MakeStreet({.seed = a.seed});
  if (!street.ok()) {
    std::fprintf(stderr, "%s\n", street.status().ToString().c_str());
    return 2;
  }
  const Client client(a.server);
  if (const auto made = client.CreateMap({.name = a.map}); !made.ok() && !absl::IsAlreadyExists(made.status())) {
    std::fprintf(stderr, "%s\n", made.status().ToString().c_str());
    return 2;
  }

  Outcome outcome;
  const auto begin = std::chrono::steady_clock::now();
  // The first drive founds the map; the others meet it.
  if (const absl::Status status = Drive(a, Client(OptionsOf(a, 0)), *street, 0, 0, outcome); !status.ok())
    outcome.Error(a.prefix + "-0", status);
  std::vector<std::thread> robots, readers;
  for (int r = 0; r < a.readers; ++r) readers.emplace_back([&, r] { Follow(a, r, outcome); });
  for (int r = 0; r < a.robots; ++r) {
    robots.emplace_back([&, r] {
      const Client own(OptionsOf(a, r));
      for (int s = r == 0 ? 1 : 0; s < a.sessions; ++s) {
        if (const absl::Status status = Drive(a, own, *street, r, s, outcome); !status.ok())
          outcome.Error(a.prefix + "-" + std::to_string(r), status);
      }
    });
  }
  for (std::thread& robot : robots) robot.join();
  outcome.uploads_ended = true;
  for (std::thread& reader : readers) reader.join();

  const nlohmann::json result = {{"sessions", outcome.sessions},
                                 {"errors", outcome.errors},
                                 {"uploaded_bytes", outcome.bytes.load()},
                                 {"map_streams", outcome.streams.load()},
                                 {"seconds", SecondsSince(begin)}};
  std::printf("%s\n", result.dump(2).c_str());
  return outcome.errors.empty() ? 0 : 1;
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) { return mapkeep::Run(argc, argv); }
