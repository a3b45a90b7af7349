#include "client/simulator/objects_file.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "client/exporters/output_file.h"

namespace mapkeep {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kTrackStep = 1;  // seconds

/// Rounded to a tenth of a millimetre: the file is for people and scores, not for casting.
double Rounded(double value) { return std::round(value * 1e4) / 1e4; }

Json Vector(const Eigen::Vector3d& v) { return {Rounded(v.x()), Rounded(v.y()), Rounded(v.z())}; }

Json Orientation(const Pose& pose) {
  const Eigen::Quaterniond q(pose.linear());
  const auto fine = [](double value) { return std::round(value * 1e7) / 1e7; };
  return {fine(q.w()), fine(q.x()), fine(q.y()), fine(q.z())};
}

Json ObjectJson(const SceneObject& object, const SimulatedSession& session, double duration) {
  const auto& [low, high] = session.mesh_bounds[object.mesh];
  const Eigen::Vector3d centre = (0.5F * (low + high)).cast<double>();
  const Pose& pose = object.track.front().pose;
  Json json = {{"id", object.id},
               {"kind", NameOf(object.kind)},
               {"state", NameOf(object.state)},
               {"centre", Vector(pose * centre)},
               {"orientation", Orientation(pose)},
               {"size", Vector((high - low).cast<double>())}};
  if (object.previous.has_value()) {
    json["previous_centre"] = Vector(*object.previous * centre);
    json["previous_orientation"] = Orientation(*object.previous);
  }
  if (object.state == ObjectState::kMoving) {
    Json track = Json::array();
    const double first = std::max(0.0, object.track.front().time);
    for (double time = first; time <= std::min(duration, object.track.back().time); time += kTrackStep) {
      const Eigen::Vector3d at = *PoseAt(object.track, time) * centre;
      track.push_back({Rounded(time), Rounded(at.x()), Rounded(at.y()), Rounded(at.z())});
    }
    json["track"] = std::move(track);
  }
  return json;
}

}  // namespace

absl::Status WriteObjects(const std::filesystem::path& path, const SimulatedSession& session) {
  absl::StatusOr<OutputFile> file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  const double start = session.times.front();
  const double duration = session.times.back() - start;
  file->stream() << R"({"format": 1, "frame": "truth", "start": )" << Json(start).dump() << R"(, "duration": )"
                 << Json(Rounded(duration)).dump() << R"(, "objects": [)";
  const char* separator = "\n";
  for (const SceneObject& object : session.objects) {
    file->stream() << separator << ObjectJson(object, session, duration).dump();
    separator = ",\n";
  }
  file->stream() << "\n]}\n";
  return file->Finish();
}

}  // namespace mapkeep
