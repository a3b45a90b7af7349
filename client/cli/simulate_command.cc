#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/cli/command_line.h"
#include "client/cli/interruption.h"
#include "client/cli/output.h"
#include "client/cli/progress_line.h"
#include "client/readers/session_directory.h"
#include "client/simulator/city.h"
#include "client/simulator/random_stream.h"
#include "client/simulator/session_files.h"
#include "client/simulator/sessions_folder.h"
#include "client/simulator/street_session.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr double kStartSpread = 3;  // metres: no two days begin at quite the same place

struct SimulateArguments {
  std::string out;
  int sessions = 2;
  int first = 1;
  bool city = false;
  StreetParameters street;
  std::string sensor = "hdl64";
  std::string layout = "kitti";
  DriveParameters drive;
  bool force = false;
};

struct Written {
  std::string name;
  size_t scans = 0;
  double metres = 0;
  size_t parked = 0, arrived = 0, moved = 0, left = 0, moving = 0;
};

Written Describe(const std::string& name, const SimulatedSession& session) {
  Written written{.name = name, .scans = session.scans.count};
  for (size_t i = 1; i < session.truth.size(); ++i) {
    written.metres += (session.truth[i].translation() - session.truth[i - 1].translation()).norm();
  }
  for (const SceneObject& object : session.objects) {
    written.parked += object.state == ObjectState::kParked ? 1 : 0;
    written.arrived += object.state == ObjectState::kArrived ? 1 : 0;
    written.moved += object.state == ObjectState::kMoved ? 1 : 0;
    written.left += object.state == ObjectState::kLeft ? 1 : 0;
    written.moving += object.state == ObjectState::kMoving ? 1 : 0;
  }
  return written;
}

void Print(const std::vector<Written>& sessions, const SimulateArguments& arguments, bool json) {
  if (json) {
    nlohmann::json rows = nlohmann::json::array();
    for (const Written& s : sessions) {
      rows.push_back({{"session", s.name},
                      {"scans", s.scans},
                      {"metres", s.metres},
                      {"parked", s.parked},
                      {"arrived", s.arrived},
                      {"moved", s.moved},
                      {"left", s.left},
                      {"moving", s.moving}});
    }
    PrintJson({{"out", arguments.out}, {"sessions", rows}});
    return;
  }
  std::vector<std::vector<std::string>> table = {
      {"session", "scans", "metres", "parked", "arrived", "moved", "left", "moving"}};
  for (const Written& s : sessions) {
    table.push_back({s.name, absl::StrCat(s.scans), absl::StrFormat("%.0f", s.metres), absl::StrCat(s.parked),
                     absl::StrCat(s.arrived), absl::StrCat(s.moved), absl::StrCat(s.left), absl::StrCat(s.moving)});
  }
  PrintTable(table);
}

/// Session `i` of the place that was asked for, made ready once.
using Drive = std::function<absl::StatusOr<SimulatedSession>(int session, const DriveParameters& drive)>;

absl::StatusOr<Drive> MakePlace(const SimulateArguments& arguments) {
  StreetParameters parameters = arguments.street;
  for (std::optional<int>* session : {&parameters.extension_from, &parameters.fence_until}) {
    if (session->has_value()) --**session;  // people count from 1
  }
  if (arguments.city) {
    if (parameters.extension_from.has_value() || parameters.fence_until.has_value()) {
      return absl::InvalidArgumentError("--extension-from and --fence-until are for a street, not for a city");
    }
    if (arguments.street.streets != 1) {
      return absl::InvalidArgumentError("--streets is not for a city, which has four");
    }
    absl::StatusOr<City> made = MakeCity(arguments.street);
    if (!made.ok()) return made.status();
    return [city = std::make_shared<const City>(*std::move(made))](int session, const DriveParameters& drive) {
      return DriveThroughCity(*city, session, drive);
    };
  }
  absl::StatusOr<Street> made = MakeStreet(parameters);
  if (!made.ok()) return made.status();
  return [street = std::make_shared<const Street>(*std::move(made))](int session, const DriveParameters& drive) {
    return DriveThrough(*street, session, drive);
  };
}

ExitCode RunSimulation(const GlobalOptions& options, const SimulateArguments& arguments) {
  const absl::StatusOr<SensorModel> sensor = SensorNamed(arguments.sensor);
  if (!sensor.ok()) return BadInput(sensor.status());
  const absl::StatusOr<SessionLayout> layout = LayoutNamed(arguments.layout);
  if (!layout.ok()) return BadInput(layout.status());
  const absl::StatusOr<Drive> place = MakePlace(arguments);
  if (!place.ok()) return BadInput(place.status());
  if (const absl::Status prepared = PrepareSessionsFolder(arguments.out, arguments.force); !prepared.ok())
    return Fail(prepared);

  const Interruption interruption;
  ProgressLine line(options.json);
  std::vector<Written> written;
  for (int i = 0; i < arguments.sessions; ++i) {
    DriveParameters drive = arguments.drive;
    drive.sensor = *sensor;
    const int day = arguments.first - 1 + i;
    drive.start += RandomStream(SeedOf(arguments.street.seed, static_cast<uint64_t>(day))).Uniform(0, kStartSpread);
    const absl::StatusOr<SimulatedSession> session = (*place)(day, drive);
    if (!session.ok()) return Fail(session.status());
    const std::string name = SessionFolderName(day);
    const absl::Status status =
        WriteSession(*session, fs::path(arguments.out) / name, *layout, PcdEncoding::kBinary, [&](double fraction) {
          line.Show(name, fraction);
          return !interruption.requested();
        });
    line.Clear();
    if (!status.ok()) return Fail(status);
    written.push_back(Describe(name, *session));
  }
  Print(written, arguments, options.json);
  return ExitCode::kDone;
}

}  // namespace

void AddSimulateCommand(CommandLine& line) {
  CLI::App* command = line.app.add_subcommand("simulate", "Make sessions of a street or a small city with known truth");
  auto arguments = std::make_shared<SimulateArguments>();
  arguments->drive.odometry.drift = 0.5;
  command->add_option("OUT", arguments->out, "Directory for session-01, session-02, ...; made if it is not there")
      ->required();
  command->add_option("--sessions", arguments->sessions, "Sessions, one a day, of the same street")
      ->type_name("N")
      ->check(CLI::Range(1, 99))
      ->capture_default_str();
  command->add_option("--scans", arguments->drive.scans, "Scans of a session, ten a second")
      ->type_name("N")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command->add_option("--seed", arguments->street.seed, "Another seed, another street")
      ->type_name("S")
      ->capture_default_str();
  command->add_option("--sensor", arguments->sensor, "hdl64, os1-64, vlp16 or livox")
      ->type_name("NAME")
      ->check(CLI::IsMember(SensorNames()))
      ->capture_default_str();
  command->add_option("--change", arguments->street.change_rate, "Share of the parked cars that change from day to day")
      ->type_name("RATE")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command->add_option("--drift", arguments->drive.odometry.drift, "Drift of the odometry in metres after 100 m")
      ->type_name("METRES")
      ->check(CLI::Range(0.0, 20.0))
      ->capture_default_str();
  command->add_option("--streets", arguments->street.streets, "Blocks of 100 m in a row, each another street")
      ->type_name("N")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_flag("--city", arguments->city, "A block of houses with four streets around it, instead of a street");
  command->add_option("--first", arguments->first, "Day of the first session")
      ->type_name("DAY")
      ->check(CLI::Range(1, 99))
      ->capture_default_str();
  command->add_option("--start", arguments->drive.start, "Metres along its route at which the robot begins")
      ->type_name("METRES")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command->add_flag("--reverse", arguments->drive.reverse, "The robot drives its route the other way round");
  command
      ->add_option("--extension-from", arguments->street.extension_from,
                   "Session, from 1, from which on a house has an extension")
      ->type_name("N")
      ->check(CLI::Range(1, 99));
  command->add_option("--fence-until", arguments->street.fence_until, "Session, from 1, from which on a fence is gone")
      ->type_name("N")
      ->check(CLI::Range(1, 99));
  command->add_option("--speed", arguments->drive.speed, "Metres a second that the robot drives")
      ->type_name("V")
      ->check(CLI::Range(0.0, 50.0))
      ->capture_default_str();
  command->add_option("--crowd", arguments->drive.traffic.crowd, "People of the crowd in each street")
      ->type_name("N")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_flag("--stop-and-go", arguments->drive.traffic.stop_and_go, "All traffic stops and starts");
  command->add_flag("--rolling-shutter", arguments->drive.rolling_shutter,
                    "Points are measured while the sensor moves, and left so");
  command->add_option("--layout", arguments->layout, "kitti, elite or kth")->type_name("NAME")->capture_default_str();
  command->add_flag("--force", arguments->force, "Replace the sessions that OUT holds");
  command->callback(
      [&line, arguments] { line.action = [&line, arguments] { return RunSimulation(line.options, *arguments); }; });
}

}  // namespace mapkeep
