#include "client/exporters/archive_exporter.h"

#include <utility>

#include "client/archive/map_archive.h"
#include "client/exporters/output_file.h"

namespace mapkeep {
namespace {

class ArchiveExporter final : public MapExporter {
 public:
  ArchiveExporter(OutputFile file, const ExportedMap& map)
      : file_(std::move(file)),
        writer_(file_.stream(), {.voxel_size = map.voxel_size, .origin = map.origin, .crs = map.crs}) {}

  absl::Status Add(const Block& block) override {
    absl::Status status = writer_.Add(block);
    count_ = writer_.voxels();
    return status;
  }

  absl::Status Finish() override {
    if (absl::Status status = writer_.Finish(); !status.ok()) return status;
    return file_.Finish();
  }

 private:
  OutputFile file_;
  ArchiveWriter writer_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<MapExporter>> OpenArchiveExporter(const std::filesystem::path& path,
                                                                 const ExportedMap& map) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  return std::make_unique<ArchiveExporter>(*std::move(file), map);
}

}  // namespace mapkeep
