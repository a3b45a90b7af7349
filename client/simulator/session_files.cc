#include "client/simulator/session_files.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <bit>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/exporters/output_file.h"
#include "client/exporters/point_file.h"
#include "client/exporters/pose_file.h"
#include "client/simulator/objects_file.h"
#include "client/simulator/pcd_scan_file.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "scan files are little-endian");

template <typename Number>
absl::Status WriteNumbers(const fs::path& path, const std::vector<Number>& numbers) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  file->stream().write(reinterpret_cast<const char*>(numbers.data()),
                       static_cast<std::streamsize>(numbers.size() * sizeof(Number)));
  return file->Finish();
}

absl::Status WriteTimes(const fs::path& path, const std::vector<double>& times) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  for (const double time : times) file->stream() << absl::StrFormat("%.6f\n", time);
  return file->Finish();
}

absl::Status MakeDirectory(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) return absl::FailedPreconditionError(absl::StrCat(path.string(), ": cannot be made: ", error.message()));
  return absl::OkStatus();
}

/// Removes the directory unless it has been given its name.
class PartialDirectory {
 public:
  static absl::StatusOr<PartialDirectory> Create(const fs::path& path) {
    std::error_code error;
    if (fs::exists(path, error)) return absl::AlreadyExistsError(absl::StrCat(path.string(), ": exists already"));
    fs::path partial = path.parent_path() / absl::StrCat(".", path.filename().string(), ".partial");
    fs::remove_all(partial, error);
    if (absl::Status made = MakeDirectory(partial); !made.ok()) return made;
    return PartialDirectory(path, std::move(partial));
  }

  PartialDirectory(PartialDirectory&& other) noexcept
      : path_(std::move(other.path_)), partial_(std::exchange(other.partial_, {})) {}
  PartialDirectory& operator=(PartialDirectory&&) = delete;
  ~PartialDirectory() {
    std::error_code ignored;
    if (!partial_.empty()) fs::remove_all(partial_, ignored);
  }

  const fs::path& partial() const { return partial_; }

  absl::Status Finish() {
    std::error_code error;
    fs::rename(partial_, path_, error);
    if (error) return absl::UnknownError(absl::StrCat(path_.string(), ": cannot be written: ", error.message()));
    partial_.clear();
    return absl::OkStatus();
  }

 private:
  PartialDirectory(fs::path path, fs::path partial) : path_(std::move(path)), partial_(std::move(partial)) {}

  fs::path path_, partial_;
};

absl::Status CannotBeWritten(SessionLayout layout) {
  return absl::InvalidArgumentError(
      absl::StrCat("layout ", std::string(NameOf(layout)), " is read, not written: expected kitti, elite or kth"));
}

std::string NumberOf(size_t index) { return absl::StrFormat("%06d", index); }

absl::Status WriteKittiScan(const LabelledScan& labelled, const fs::path& directory, size_t index) {
  std::vector<float> numbers;
  numbers.reserve(4 * labelled.scan.points.size());
  for (size_t i = 0; i < labelled.scan.points.size(); ++i) {
    const Eigen::Vector3f& p = labelled.scan.points[i];
    numbers.insert(numbers.end(), {p.x(), p.y(), p.z(), labelled.scan.intensities[i]});
  }
  absl::Status status = WriteNumbers(directory / "velodyne" / (NumberOf(index) + ".bin"), numbers);
  status.Update(WriteNumbers(directory / "label" / (NumberOf(index) + ".label"), labelled.labels));
  return status;
}

absl::Status WriteKthScan(const LabelledScan& labelled, const Pose& pose, const fs::path& file, PcdEncoding encoding,
                          PointFileWriter& truth) {
  Scan in_world = labelled.scan;
  for (size_t i = 0; i < in_world.points.size(); ++i) {
    const Eigen::Vector3d point = pose * in_world.points[i].cast<double>();
    const uint32_t label = ClassOfLabel(labelled.labels[i]);
    if (label != kUnsureLabel) truth.Add(point, label == kMovingLabel ? 1 : 0);
    in_world.points[i] = point.cast<float>();
  }
  return WritePcdScan(file, in_world, pose, encoding);
}

absl::Status WriteScans(const SimulatedSession& session, const fs::path& directory, SessionLayout layout,
                        PcdEncoding encoding, const Progress& progress) {
  std::optional<PointFileWriter> truth;
  if (layout == SessionLayout::kKth) {
    auto created = PointFileWriter::Create(directory / "gt_cloud.pcd", CoordinateType::kFloat32);
    if (!created.ok()) return created.status();
    truth.emplace(*std::move(created));
  }
  const auto count = static_cast<double>(session.scans.count);
  for (size_t i = 0; i < session.scans.count; ++i) {
    if (progress && !progress(static_cast<double>(i) / count)) return absl::CancelledError("stopped");
    absl::StatusOr<LabelledScan> labelled = session.labelled(i);
    if (!labelled.ok()) return labelled.status();
    absl::Status status;
    switch (layout) {
      case SessionLayout::kKitti:
        status = WriteKittiScan(*labelled, directory, i);
        break;
      case SessionLayout::kElite:
        status = WritePcdScan(directory / "Scans" / (NumberOf(i) + ".pcd"), labelled->scan, Pose::Identity(), encoding);
        break;
      case SessionLayout::kKth:
        status =
            WriteKthScan(*labelled, session.odometry[i], directory / "pcd" / (NumberOf(i) + ".pcd"), encoding, *truth);
        break;
      default:
        return CannotBeWritten(layout);
    }
    if (!status.ok()) return status;
  }
  if (progress) progress(1);
  return truth.has_value() ? truth->Finish() : absl::OkStatus();
}

std::vector<const char*> FoldersOf(SessionLayout layout) {
  switch (layout) {
    case SessionLayout::kKitti:
      return {"velodyne", "label"};
    case SessionLayout::kElite:
      return {"Scans"};
    case SessionLayout::kKth:
      return {"pcd"};
    default:
      return {};
  }
}

}  // namespace

absl::Status WriteSession(const SimulatedSession& session, const fs::path& directory, SessionLayout layout,
                          PcdEncoding encoding, const Progress& progress) {
  if (FoldersOf(layout).empty()) return CannotBeWritten(layout);
  absl::StatusOr<PartialDirectory> created = PartialDirectory::Create(directory);
  if (!created.ok()) return created.status();
  const fs::path& partial = created->partial();
  absl::Status status;
  for (const char* folder : FoldersOf(layout)) status.Update(MakeDirectory(partial / folder));
  status.Update(WriteTimes(partial / "times.txt", session.times));
  status.Update(WritePoses(partial / "truth_poses.txt", session.truth));
  status.Update(WriteObjects(partial / "objects.json", session));
  if (layout != SessionLayout::kKth) status.Update(WritePoses(partial / "poses.txt", session.odometry));
  if (!status.ok()) return status;
  status = WriteScans(session, partial, layout, encoding, progress);
  if (!status.ok()) return status;
  return created->Finish();
}

}  // namespace mapkeep
