// A robot: uploads a drive, keeps the map's tiles in a folder, and asks where it is. robot SERVER MAP DRIVE TILES
#include <mapkeep/client.h>

#include <fstream>
#include <iostream>

int main(int argc, char** argv) {
  if (argc != 5) return std::cerr << "robot SERVER MAP DRIVE TILES\n", 2;
  const std::string map = argv[2], drive = argv[3];
  const auto fail = [](const absl::Status& status) { return std::cerr << status << "\n", 1; };

  std::vector<mapkeep::Scan> scans;  // a real robot has them from its sensor and its odometry
  std::vector<mapkeep::Pose> poses;
  std::ifstream rows(drive + "/poses.txt"), times(drive + "/times.txt");
  for (mapkeep::Pose pose = mapkeep::Pose::Identity();; poses.push_back(pose)) {
    for (int i = 0; i < 12; ++i) rows >> pose.matrix()(i / 4, i % 4);
    if (!rows) break;
    char name[16];
    std::snprintf(name, sizeof name, "%06zu.bin", scans.size());
    std::ifstream points(drive + "/velodyne/" + name, std::ios::binary);
    mapkeep::Scan& scan = scans.emplace_back();
    times >> scan.time;
    for (float p[4]; points.read(reinterpret_cast<char*>(p), sizeof p); scan.intensities.push_back(p[3])) {
      scan.points.emplace_back(p[0], p[1], p[2]);
    }
  }

  const mapkeep::Client client({.server = argv[1]});
  const mapkeep::ScanSource source = mapkeep::SourceOf(scans);
  const mapkeep::ScanEncoding encoding = mapkeep::ScanEncoding::kDraco1Cm;
  const auto checksums = mapkeep::ScanChecksums(source, poses, {}, encoding);
  if (!checksums.ok()) return fail(checksums.status());
  const auto sent = client.UploadSession({map, "robot-drive", "robot", false, source, poses, *checksums, encoding});
  if (!sent.ok()) return fail(sent.status());
  const auto ended = client.WatchSession(map, "robot-drive", [](const mapkeep::SessionInfo&) { return true; });
  if (!ended.ok()) return fail(ended.status());
  const auto tiles = mapkeep::SyncTileFolder(client, {.map = map}, argv[4]);
  if (!tiles.ok()) return fail(tiles.status());
  scans.resize(10), poses.resize(10);
  const auto place = client.Localize({map, mapkeep::SourceOf(scans), poses, {}, encoding});
  if (!place.ok()) return fail(place.status());
  std::cout << NameOf(ended->state) << ", " << ended->payload_bytes / ended->durable_scans << " bytes a scan, "
            << tiles->tiles << " tiles, found " << place->found << " at " << place->pose.translation().transpose()
            << "\n";
}
