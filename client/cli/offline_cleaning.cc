#include "client/cli/offline_cleaning.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>
#include <absl/time/time.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "client/exporters/output_file.h"
#include "client/exporters/point_file.h"
#include "core/dor/pose_refinement.h"
#include "core/dor/remover.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

/// Scans that are labelled at a time, before they are written in order.
constexpr size_t kBatch = 32;

/// Farther from zero than this, voxels are counted from a shifted origin, as a map's are, and coordinates are float64.
constexpr double kFarFromZero = 10'000;  // metres
constexpr double kOriginStep = 100;      // metres

/// Adds the time of its own life to a sum of seconds.
class Stopwatch {
 public:
  explicit Stopwatch(double* seconds) : seconds_(seconds), start_(absl::Now()) {}
  ~Stopwatch() { *seconds_ += absl::ToDoubleSeconds(absl::Now() - start_); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  double* seconds_;
  absl::Time start_;
};

/// Calls `work(i)` for i in [first, first + count) on several threads; gives the error of the lowest i that has one.
absl::Status ForEachInParallel(size_t first, size_t count, const std::function<absl::Status(size_t)>& work) {
  std::vector<absl::Status> results(count);
  tbb::parallel_for(size_t{0}, count, [&](size_t i) { results[i] = work(first + i); });
  const auto bad = std::find_if(results.begin(), results.end(), [](const absl::Status& s) { return !s.ok(); });
  return bad == results.end() ? absl::OkStatus() : *bad;
}

/// The scans of a directory, held in memory if they fit.
class Scans {
 public:
  explicit Scans(const SessionDirectory& directory) : directory_(directory) {
    uint64_t bytes = directory.bytes;
    for (const fs::path& file : directory.files) {
      if (directory.bytes > 0) break;
      std::error_code error;
      const uintmax_t size = fs::file_size(file, error);
      if (!error) bytes += size;
    }
    if (bytes <= kHeldBytes) held_.resize(directory.files.size());
  }

  bool AreHeld() const { return !held_.empty(); }

  /// Reads every scan once, so that a bad one is found at the start.
  absl::Status Load(const StageProgress& progress) {
    const size_t count = directory_.files.size();
    for (size_t first = 0; first < count; first += kBatch) {
      if (!progress("read", static_cast<double>(first) / static_cast<double>(count))) {
        return absl::CancelledError("stopped");
      }
      absl::Status read = ForEachInParallel(first, std::min(kBatch, count - first), [this](size_t i) {
        absl::StatusOr<CheckedScan> scan = ReadScan(directory_, i);
        if (!scan.ok()) return scan.status();
        if (AreHeld()) held_[i] = std::make_shared<const CheckedScan>(*std::move(scan));
        return absl::OkStatus();
      });
      if (!read.ok()) return read;
    }
    return absl::OkStatus();
  }

  absl::StatusOr<std::shared_ptr<const CheckedScan>> Read(size_t index) const {
    if (AreHeld()) return held_[index];
    absl::StatusOr<CheckedScan> scan = ReadScan(directory_, index);
    if (!scan.ok()) return scan.status();
    return std::make_shared<const CheckedScan>(*std::move(scan));
  }

  ScanSource Source() const {
    return {directory_.files.size(), [this](size_t index) -> absl::StatusOr<Scan> {
              const auto scan = Read(index);
              if (!scan.ok()) return scan.status();
              return (*scan)->scan;
            }};
  }

 private:
  const SessionDirectory& directory_;
  std::vector<std::shared_ptr<const CheckedScan>> held_;
};

/// The class of every point of the scan's file.
std::vector<LabelClass> ClassesOf(const CheckedScan& checked, std::span<const PointLabel> labels) {
  std::vector<LabelClass> classes;
  classes.reserve(labels.size() + checked.no_returns.size());
  auto no_return = checked.no_returns.begin();
  for (size_t i = 0; i < labels.size() || no_return != checked.no_returns.end();) {
    if (no_return != checked.no_returns.end() && *no_return == classes.size()) {
      classes.push_back(LabelClass::kNoReturn);
      ++no_return;
    } else {
      classes.push_back(labels[i++] == PointLabel::kDynamic ? LabelClass::kRemoved : LabelClass::kKept);
    }
  }
  return classes;
}

absl::Status WriteClasses(const fs::path& path, std::span<const LabelClass> classes) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  file->stream().write(reinterpret_cast<const char*>(classes.data()),
                       static_cast<std::streamsize>(classes.size_bytes()));
  return file->Finish();
}

/// Adds the points that were kept, in the session's frame.
void AddKept(const Scan& scan, std::span<const PointLabel> labels, const Pose& pose, PointFileWriter* points) {
  for (size_t i = 0; i < labels.size(); ++i) {
    if (labels[i] == PointLabel::kDynamic) continue;
    points->Add(pose * scan.points[i].cast<double>(), scan.intensities.empty() ? 0.F : scan.intensities[i]);
  }
}

absl::Status MakeDirectory(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (!error) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(path.string(), ": cannot be made: ", error.message()));
}

/// Labels every scan and writes what the command promises, a batch at a time.
absl::Status WriteResults(const SessionDirectory& directory, const Scans& scans, const Removal& removal,
                          CoordinateType coordinates, const fs::path& out, const StageProgress& progress,
                          CleaningReport* report) {
  absl::Status status = MakeDirectory(out / "labels");
  if (!status.ok()) return status;
  absl::StatusOr<PointFileWriter> points = PointFileWriter::Create(out / "static.pcd", coordinates);
  if (!points.ok()) return points.status();
  const size_t count = directory.files.size();
  std::vector<std::shared_ptr<const CheckedScan>> batch(kBatch);
  std::vector<std::vector<PointLabel>> labels(kBatch);
  for (size_t first = 0; first < count; first += kBatch) {
    if (!progress("label", static_cast<double>(first) / static_cast<double>(count))) {
      return absl::CancelledError("stopped");
    }
    const size_t size = std::min(kBatch, count - first);
    {
      const Stopwatch watch(&report->read_seconds);
      status = ForEachInParallel(0, size, [&](size_t i) {
        absl::StatusOr<std::shared_ptr<const CheckedScan>> scan = scans.Read(first + i);
        if (!scan.ok()) return scan.status();
        batch[i] = *std::move(scan);
        return absl::OkStatus();
      });
      if (!status.ok()) return status;
    }
    {
      const Stopwatch watch(&report->label_seconds);
      std::vector<LabelCounts> counts(size);
      tbb::parallel_for(size_t{0}, size,
                        [&](size_t i) { labels[i] = removal.Label(first + i, batch[i]->scan, &counts[i]); });
      for (const LabelCounts& of_scan : counts) report->points_restored += of_scan.restored;
    }
    const Stopwatch watch(&report->write_seconds);
    for (size_t i = 0; i < size; ++i) {
      const fs::path name = directory.files[first + i].stem();
      status = WriteClasses(out / "labels" / (name.string() + ".label"), ClassesOf(*batch[i], labels[i]));
      if (!status.ok()) return status;
      AddKept(batch[i]->scan, labels[i], directory.poses[first + i], &*points);
      report->points += labels[i].size();
      report->points_removed +=
          static_cast<uint64_t>(std::count(labels[i].begin(), labels[i].end(), PointLabel::kDynamic));
      report->no_returns += batch[i]->no_returns.size();
    }
  }
  const Stopwatch watch(&report->write_seconds);
  return points->Finish();
}

/// Where voxels are counted from: zero, or a round point near a start that is far from it.
Eigen::Vector3d OriginFor(const Pose& start) {
  const Eigen::Vector3d& position = start.translation();
  if (position.norm() <= kFarFromZero) return Eigen::Vector3d::Zero();
  return kOriginStep * (position / kOriginStep).array().round();
}

}  // namespace

absl::StatusOr<CleaningReport> CleanSession(const SessionDirectory& directory, const fs::path& out,
                                            const StageProgress& progress) {
  CleaningReport report{.scans = directory.files.size()};
  Scans scans(directory);
  report.removal_reads_files = !scans.AreHeld();
  {
    const Stopwatch watch(&report.read_seconds);
    const absl::Status loaded = scans.Load(progress);
    if (!loaded.ok()) return loaded;
  }

  const Eigen::Vector3d origin = OriginFor(directory.poses.front());
  std::vector<Pose> poses = directory.poses;
  for (Pose& pose : poses) pose.pretranslate(-origin);
  SessionDirectory refined = directory;
  absl::StatusOr<Removal> removal = absl::InternalError("not run");
  {
    const Stopwatch watch(&report.remove_seconds);
    if (DorParameters().refine_poses) {
      absl::StatusOr<std::vector<Pose>> better =
          RefinePoses(scans.Source(), poses, DorParameters().refinement,
                      {[&](double fraction) { return progress("refine", fraction); }});
      if (!better.ok()) return better.status();
      for (size_t i = 0; i < poses.size(); ++i) {
        if (poses[i].isApprox((*better)[i], 0)) continue;
        poses[i] = (*better)[i];
        refined.poses[i] = poses[i];
        refined.poses[i].pretranslate(origin);
      }
    }
    removal = RemoveDynamicObjects(scans.Source(), poses, {}, DorParameters(),
                                   [&](double fraction) { return progress("remove", fraction); });
    if (!removal.ok()) return removal.status();
  }
  report.voxels = removal->report().voxels;
  report.dynamic_voxels = removal->report().dynamic_voxels;
  report.ground_voxels = removal->report().ground_voxels;

  const CoordinateType coordinates = origin.isZero() ? CoordinateType::kFloat32 : CoordinateType::kFloat64;
  const absl::Status written = WriteResults(refined, scans, *removal, coordinates, out, progress, &report);
  if (!written.ok()) return written;
  return report;
}

}  // namespace mapkeep
