// registration_bench KITTI_DIR [CASES [METRES DEGREES [MAP SESSION]]]
// MAP and SESSION are frames FIRST:LAST:STEP, both ends inclusive; by default the even ones make the map and the odd
// ones are the session. It is moved by a random rigid motion of up to METRES and DEGREES a case. Prints the errors of
// the aligned scan poses against the given ones and the milliseconds a scan. At last the session is mirrored left to
// right: a street that the map does not know, to be refused. Ends with status 1 if a case was refused or a scan is more
// than 0.12 m or 0.3 degrees off, or the mirrored session was accepted.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <random>

#include "core/ratio_map/session_map.h"
#include "core/registration/aligner.h"
#include "core/voxels/normal.h"
#include "tests/bench/kitti_directory.h"

namespace mapkeep {
namespace {

constexpr double kVoxel = 0.2;

// Every voxel that a point fell into; no exposures.
Evidence HitsOf(const ScanSource& scans, std::span<const Pose> poses) {
  std::vector<VoxelKey> keys;
  for (size_t i = 0; i < scans.count; ++i) {
    const auto scan = scans.read(i);
    for (const Eigen::Vector3f& point : scan->points) {
      keys.push_back(VoxelKeyOf(*VoxelIndexOf(poses[i] * point.cast<double>(), kVoxel)));
    }
    std::ranges::sort(keys);
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  }
  return {kVoxel, keys, std::vector<uint32_t>(keys.size(), 1), std::vector<uint32_t>(keys.size())};
}

RegistrationTarget TargetOf(const SessionMap& map) {
  RegistrationTarget target{.voxel_size = kVoxel};
  for (const SessionVoxel& voxel : map.voxels) {
    const Eigen::Vector3d inside(voxel.mean[0] + 0.5, voxel.mean[1] + 0.5, voxel.mean[2] + 0.5);
    target.points.push_back(CornerOf(VoxelIndexOf(voxel.key), kVoxel) + inside * (kVoxel / 256));
    target.normals.push_back(DecodeNormal(voxel.normal));
  }
  return target;
}

// Of all threads of this program.
double ProcessorSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double Seconds(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count();
}

// Some frames of a directory with their poses.
struct Session {
  ScanSource scans;
  std::vector<Pose> poses;
};

Session SessionOf(const KittiDirectory& directory, const std::string& range) {
  size_t first = 0, last = 0, step = 1;
  if (std::sscanf(range.c_str(), "%zu:%zu:%zu", &first, &last, &step) < 2 || step == 0 || last < first) {
    std::fprintf(stderr, "%s: expected FIRST:LAST:STEP\n", range.c_str());
    std::exit(2);
  }
  Session session;
  std::vector<size_t> frames;
  for (size_t i = first; i <= last && i < directory.poses.size(); i += step) {
    frames.push_back(i);
    session.poses.push_back(directory.poses[i]);
  }
  session.scans = directory.Source(frames);
  return session;
}

// y becomes -y in scans and poses.
Session Mirrored(const Session& session) {
  const Eigen::DiagonalMatrix<double, 3> mirror(1, -1, 1);
  Session mirrored{.scans = session.scans};
  mirrored.scans.read = [read = session.scans.read](size_t index) {
    auto scan = read(index);
    for (Eigen::Vector3f& point : scan->points) point.y() = -point.y();
    return scan;
  };
  for (Pose pose : session.poses) {
    pose.linear() = mirror * pose.linear() * mirror;
    pose.translation().y() = -pose.translation().y();
    mirrored.poses.push_back(pose);
  }
  return mirrored;
}

constexpr double kMostMetres = 0.12, kMostDegrees = 0.3;  // of any scan

// Whether every scan lies where it should.
bool Print(const Alignment& alignment, const std::vector<Pose>& truth, double seconds, double processor) {
  bool good = alignment.accepted;
  if (alignment.accepted) {
    std::vector<double> metres, degrees;
    for (size_t i = 0; i < truth.size(); ++i) {
      metres.push_back((alignment.poses[i].translation() - truth[i].translation()).norm());
      degrees.push_back(AngleBetween(alignment.poses[i], truth[i]) * 180 / std::numbers::pi);
    }
    std::ranges::sort(metres);
    std::ranges::sort(degrees);
    std::printf("error median %.3f m %.3f deg, worst %.3f m %.3f deg; %.1f ms a scan (%.1f of processor time);",
                metres[metres.size() / 2], degrees[degrees.size() / 2], metres.back(), degrees.back(),
                1000 * seconds / static_cast<double>(truth.size()),
                1000 * processor / static_cast<double>(truth.size()));
    good = metres.back() <= kMostMetres && degrees.back() <= kMostDegrees;
  } else {
    std::printf("refused: %s;", alignment.reason.c_str());
  }
  for (const WindowResult& window : alignment.windows) {
    std::printf(" %u-%u:%s%.3f/%.3f", window.first_scan, window.last_scan, window.trusted ? "" : "!", window.fitness,
                window.observability);
  }
  std::printf("\n");
  return good;
}

// A random rigid motion about a place.
Pose MotionAbout(const Eigen::Vector3d& place, double metres, double degrees, std::mt19937& random) {
  std::normal_distribution<double> any;
  std::uniform_real_distribution<double> share(0, 1);
  const Eigen::Vector3d axis = Eigen::Vector3d(any(random), any(random), any(random)).normalized();
  const Eigen::Vector3d shift = Eigen::Vector3d(any(random), any(random), any(random)).normalized();
  const Eigen::Translation3d middle(place);
  return Eigen::Translation3d(metres * share(random) * shift) * middle *
         Eigen::AngleAxisd(degrees * share(random) * std::numbers::pi / 180, axis) * middle.inverse();
}

// Turned about z and moved, as a robot's own frame is.
Pose TurnAndShift(double metres, double degrees, std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  const Eigen::Vector3d shift(metres * any(random), metres * any(random), 3 * any(random));
  return Eigen::Translation3d(shift) *
         Eigen::AngleAxisd(degrees * any(random) * std::numbers::pi / 180, Eigen::Vector3d::UnitZ());
}

int Run(int count, char** arguments) {
  if (count < 2) {
    std::fprintf(stderr, "usage: registration_bench KITTI_DIR [CASES [METRES DEGREES [MAP SESSION]]]\n");
    return 2;
  }
  const KittiDirectory directory(arguments[1]);
  const int cases = count > 2 ? std::atoi(arguments[2]) : 5;
  const double metres = count > 4 ? std::atof(arguments[3]) : 0.5;
  const double degrees = count > 4 ? std::atof(arguments[4]) : 2.0;
  const std::string end = std::to_string(directory.poses.size() - 1);
  const Session founder = SessionOf(directory, count > 6 ? arguments[5] : "0:" + end + ":2");
  const Session session = SessionOf(directory, count > 6 ? arguments[6] : "1:" + end + ":2");

  const auto all_static = [](size_t, const Scan& scan) {
    return std::vector<PointLabel>(scan.points.size(), PointLabel::kStatic);
  };
  const Evidence evidence = HitsOf(founder.scans, founder.poses);
  const auto start = std::chrono::steady_clock::now();
  const auto map = BuildSessionMap(founder.scans, founder.poses, all_static, evidence, 0, {});
  if (!map.ok()) {
    std::fprintf(stderr, "%s\n", map.status().ToString().c_str());
    return 1;
  }
  std::printf("session map: %zu voxels, %.2f s\n", map->voxels.size(), Seconds(start));
  const auto found_start = std::chrono::steady_clock::now();
  const auto found = FoundMapFrame(founder.scans, founder.poses, {});
  std::printf("FoundMapFrame: %s, %.2f s\n", found->accepted ? "accepted" : found->reason.c_str(),
              Seconds(found_start));
  const TargetMap target = MapOf(TargetOf(*map));

  std::mt19937 random(1);
  bool good = true;
  for (int n = 0; n < cases; ++n) {
    Pose motion = MotionAbout(session.poses[session.poses.size() / 2].translation(), metres, degrees, random);
    // More than a tilt can be is a turn about the vertical, which in these frames is z.
    if (degrees > 10) motion = TurnAndShift(metres, degrees, random);
    std::vector<Pose> poses;
    double moved = 0;
    for (const Pose& pose : session.poses) {
      poses.push_back(motion * pose);
      moved = std::max(moved, (poses.back().translation() - pose.translation()).norm());
    }
    const auto begin = std::chrono::steady_clock::now();
    const double processor_before = ProcessorSeconds();
    const auto alignment = AlignSession(session.scans, poses, target, {}, {});
    std::printf("case %d: moved up to %.2f m; ", n, moved);
    good = Print(*alignment, session.poses, Seconds(begin), ProcessorSeconds() - processor_before) && good;
  }
  {
    const auto begin = std::chrono::steady_clock::now();
    const double processor_before = ProcessorSeconds();
    const auto tracked = AlignSession(session.scans, session.poses, target, Pose::Identity(), {});
    std::printf("tracked from where it lies: ");
    good = Print(*tracked, session.poses, Seconds(begin), ProcessorSeconds() - processor_before) && good;
  }
  const Session foreign = Mirrored(session);
  std::printf("mirrored: ");
  const auto lost = AlignSession(foreign.scans, foreign.poses, target, {}, {});
  Print(*lost, foreign.poses, 0, 0);
  return good && !lost->accepted ? 0 : 1;
}

}  // namespace
}  // namespace mapkeep

int main(int count, char** arguments) { return mapkeep::Run(count, arguments); }
