// kill -9 amid everything, full disks, damaged files: through a real daemon.

#include <gmock/gmock.h>
#include <sys/mount.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <random>
#include <sstream>
#include <thread>

#include "tests/integration/daemon_process.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"
#include "tests/integration/upkeep.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;

constexpr double kStart = 1.79e9;  // seconds since 1970
constexpr int kScans = 16;

const bool kLong = std::getenv("MAPKEEP_LONG") != nullptr;

std::string Id(char robot, int number) { return std::string(1, robot).append(std::to_string(number)); }

void Sleep(int milliseconds) { std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds)); }

// Drives that overlap, with a car that comes and goes, so that every merge and its order leave their mark.
Drive AnyDrive(int number) {
  Scene scene = Street();
  if (number % 3 == 1) scene.push_back(Car());
  return DriveAlong(scene, kScans, kStart + 3600.0 * number, {0, 0, 0}, -4.0 + 2.0 * (number % 5));
}

// What goes on while the daemon is killed.
struct Flow {
  std::atomic<bool> stop = false;    // end what is begun
  std::atomic<bool> broken = false;  // the test has failed: end at once
  std::atomic<int> uploading = 0, collecting = 0, backing_up = 0;
  std::atomic<int> collections = 0, backups = 0;
  std::atomic<size_t> queued = 0;
  std::mutex commit_mutex;                // so that there is one order of CommitSession
  std::vector<std::string> acknowledged;  // in that order
  std::string newest_backup;

  void Up(std::string at) {
    const std::lock_guard lock(mutex_);
    address_ = std::move(at);
  }
  void Down() { Up(""); }

  /// A robot on the daemon, once it is up; nullptr if the test has failed.
  std::unique_ptr<Robot> NewRobot() const {
    while (!broken) {
      {
        const std::lock_guard lock(mutex_);
        if (!address_.empty()) return std::make_unique<Robot>(address_);
      }
      Sleep(5);
    }
    return nullptr;
  }

 private:
  mutable std::mutex mutex_;
  std::string address_;
};

// However a test is left, nobody goes on.
struct EndOf {
  Flow& flow;
  ~EndOf() { flow.stop = flow.broken = true; }
};

// Uploads until every scan is durable, from wherever it was cut off.
void UploadWhole(Flow& flow, const std::string& id, const Drive& drive) {
  const std::vector<WireScan> scans = Wire(drive);
  ++flow.uploading;
  while (const auto robot = flow.NewRobot()) {
    v1::Session session;
    if (!robot->Begin("street", id, scans, &session, true).ok()) continue;
    if (session.durable_scans() == scans.size()) break;
    const auto call = Robot::Call();
    const auto upload = robot->Open(*call, "street", id);
    bool whole = true;
    for (size_t i = session.durable_scans(); whole && i < scans.size(); ++i) whole = Robot::Send(*upload, scans[i]);
    Robot::End(*upload);
  }
  --flow.uploading;
}

void WaitUntilOver(Flow& flow, const std::string& id) {
  while (const auto robot = flow.NewRobot()) {
    v1::Session session;
    const grpc::Status status = robot->GetSession("street", id, session);
    if (status.ok() && session.state() != v1::SESSION_STATE_QUEUED && session.state() != v1::SESSION_STATE_RUNNING) {
      return;
    }
    Sleep(20);
  }
}

// A robot that drives on and on, at most two drives ahead of the map.
void DriveOn(Flow& flow, char name, int first, int step) {
  std::vector<std::string> mine;
  for (int number = first; !flow.stop; number += step) {
    const std::string id = Id(name, number);
    UploadWhole(flow, id, AnyDrive(number));
    {
      const std::lock_guard lock(flow.commit_mutex);
      while (const auto robot = flow.NewRobot()) {
        if (robot->Commit("street", id).ok()) break;
      }
      if (flow.broken) return;
      flow.acknowledged.push_back(id);
      ++flow.queued;
    }
    mine.push_back(id);
    if (mine.size() > 2) WaitUntilOver(flow, mine[mine.size() - 3]);
  }
}

// Collects and backs up in turns; keeps the newest backup that was finished.
void KeepUp(Flow& flow, const std::string& directory) {
  for (int turn = 0; !flow.stop; ++turn) {
    const auto robot = flow.NewRobot();
    if (robot == nullptr) return;
    ++flow.collecting;
    v1::CollectGarbageResponse collected;
    flow.collections += robot->admin().CollectGarbage(Robot::Call().get(), {}, &collected).ok() ? 1 : 0;
    --flow.collecting;
    v1::BackupRequest backup;
    backup.set_directory(directory + "/" + std::to_string(turn));
    v1::BackupResponse made;
    ++flow.backing_up;
    if (robot->admin().Backup(Robot::Call().get(), backup, &made).ok()) {
      if (!flow.newest_backup.empty()) fs::remove_all(flow.newest_backup);
      flow.newest_backup = backup.directory();
      ++flow.backups;
    } else {
      fs::remove_all(backup.directory());
      fs::remove_all(backup.directory() + ".tmp");
    }
    --flow.backing_up;
    Sleep(20);
  }
}

// The map that the same sessions make, one after the other, where nothing happens.
std::string UndisturbedMap(const std::vector<std::string>& sessions) {
  const DaemonProcess daemon({"--serial-per-map"});
  Robot robot(daemon.listen());
  EXPECT_THAT(robot.CreateMap("street"), IsOk());
  for (const std::string& id : sessions) {
    EXPECT_THAT(robot.UploadDrive("street", id, AnyDrive(std::stoi(id.substr(1)))), IsOk());
    EXPECT_EQ(robot.Watch("street", id).state(), v1::SESSION_STATE_COMMITTED) << id;
  }
  return BytesOf(robot.Tiles("street", true));
}

void ExpectRestorable(Robot& robot, const std::string& backup) {
  v1::RestoreRequest restore;
  restore.set_directory(backup);
  restore.set_map("street");
  restore.set_as("restored");
  v1::RestoreResponse restored;
  grpc::ClientContext as_long_as_it_takes;
  ASSERT_THAT(robot.admin().Restore(&as_long_as_it_takes, restore, &restored), IsOk());
  EXPECT_THAT(Verify(robot, "restored").problems(), IsEmpty());
}

// Few epochs are kept, so that there is always something to collect.
std::vector<std::string> ShortMemory(const std::string& directory) {
  const std::string file = directory + "/mapkeepd.toml";
  std::ofstream(file) << "serial_per_map = true\n[history]\nkeep_epochs = 5\ncollect_seconds = 1\n";
  return {"--config", file};
}

TEST(Faults, WheneverTheDaemonIsKilledTheMapIsThatOfADayWithoutKills) {
  const char* const wanted = std::getenv("MAPKEEP_ROUNDS");  // by hand: as many as there is time for
  const int rounds = wanted != nullptr ? std::stoi(wanted) : kLong ? 300 : 3;
  std::mt19937_64 random(3);
  const TemporaryDirectory directory;
  DaemonProcess daemon(ShortMemory(directory.path()));
  ASSERT_THAT(Robot(daemon.listen()).CreateMap("street"), IsOk());
  Flow flow;
  flow.Up(daemon.listen());
  int amid_upload = 0, amid_merge = 0, amid_collection = 0, amid_backup = 0;
  {
    std::jthread a([&] { DriveOn(flow, 'a', 0, 2); });
    std::jthread b([&] { DriveOn(flow, 'b', 1, 2); });
    std::jthread upkeep([&] { KeepUp(flow, directory.path()); });
    const EndOf end{flow};
    for (int round = 0; round < rounds; ++round) {
      Sleep(100 + static_cast<int>(random() % 700));
      v1::Map map;
      Robot(daemon.listen()).GetMap("street", map);
      amid_upload += flow.uploading > 0 ? 1 : 0;
      amid_collection += flow.collecting > 0 ? 1 : 0;
      amid_backup += flow.backing_up > 0 ? 1 : 0;
      amid_merge += map.sessions() < flow.queued ? 1 : 0;
      flow.Down();
      daemon.Kill();
      daemon.Start();
      Robot robot(daemon.listen());
      flow.Up(daemon.listen());
      ASSERT_THAT(Verify(robot, "street").problems(), IsEmpty()) << "round " << round;
    }
    flow.stop = true;  // what the robots have begun goes through
    for (std::jthread* thread : {&a, &b, &upkeep}) thread->join();
  }
  Robot robot(daemon.listen());
  for (const std::string& id : flow.acknowledged) {
    const v1::Session session = robot.Watch("street", id);
    EXPECT_EQ(session.state(), v1::SESSION_STATE_COMMITTED) << id << ": " << session.reason();
  }
  EXPECT_EQ(SessionsOf(robot, "street"), flow.acknowledged) << "each once, in the order of CommitSession";
  ExpectWhole(robot, "street", flow.acknowledged.size());
  EXPECT_EQ(BytesOf(robot.Tiles("street", true)), UndisturbedMap(flow.acknowledged));
  EXPECT_GT(flow.collections, 0);
  if (!flow.newest_backup.empty()) ExpectRestorable(robot, flow.newest_backup);
  std::printf(
      "%d kills: %d amid an upload, %d a merge or commit, %d a collection, %d a backup; %zu sessions, %d collections "
      "and "
      "%d backups went through\n",
      rounds, amid_upload, amid_merge, amid_collection, amid_backup, flow.acknowledged.size(), flow.collections.load(),
      flow.backups.load());
}

// A small file system of its own on a directory, for the life of this.
class SmallDisk {
 public:
  SmallDisk(std::string directory, const std::string& size) : directory_(std::move(directory)) {
    fs::create_directories(directory_);
    mounted_ = mount("tmpfs", directory_.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted_) umount2(directory_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  bool mounted() const { return mounted_; }

  /// Leaves so many bytes free.
  void Fill(uint64_t left) const {
    std::ofstream file(filler(), std::ios::binary);
    const std::vector<char> zeros(4096);
    while (fs::space(directory_).available > left && file.write(zeros.data(), 4096).flush()) continue;
  }
  void Free() const { fs::remove(filler()); }

 private:
  std::string filler() const { return directory_ + "/filler"; }

  std::string directory_;
  bool mounted_ = false;
};

// Begins the session, or goes on where it was cut off, and queues it.
grpc::Status GoOn(Robot& robot, const std::string& id, const Drive& drive) {
  const std::vector<WireScan> scans = Wire(drive);
  v1::Session session;
  if (grpc::Status status = robot.Begin("street", id, scans, &session, true); !status.ok()) return status;
  if (session.state() != v1::SESSION_STATE_UPLOADING) return grpc::Status::OK;
  if (session.durable_scans() < scans.size()) {
    const grpc::Status status = robot.Send("street", id, {scans.begin() + session.durable_scans(), scans.end()});
    if (!status.ok()) return status;
  }
  return robot.Commit("street", id);
}

TEST(Faults, AFullDiskRefusesUploadsReadsGoOnAndEverythingGoesOnOnceThereIsSpace) {
  constexpr int kSessions = 5;
  DaemonProcess daemon;
  ASSERT_EQ(daemon.End(SIGTERM), 0);
  const SmallDisk disk(daemon.data(), "48m");  // too small for what RocksDB would set aside for its log
  if (!disk.mounted()) GTEST_SKIP() << "mounting a small file system needs root";
  daemon.Start();
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  ASSERT_THAT(robot.UploadDrive("street", "a0", AnyDrive(0), true), IsOk());
  ASSERT_EQ(robot.Watch("street", "a0").state(), v1::SESSION_STATE_COMMITTED);
  const std::string before = BytesOf(robot.Tiles("street", true));

  // Full before anything of an upload is durable, then with room for a part of it.
  int refused = 0;
  for (const uint64_t left : {uint64_t{0}, uint64_t{1} << 20}) {
    disk.Fill(left);
    for (int number = 1; number < kSessions; ++number) {
      const grpc::Status status = GoOn(robot, Id('a', number), AnyDrive(number));
      if (status.ok()) continue;
      EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
      ++refused;
      break;
    }
    v1::StreamTilesRequest first;
    first.set_map("street");
    first.set_epoch(1);
    first.set_include_all(true);
    EXPECT_EQ(BytesOf(robot.Tiles(first)), before) << "what is there is read";
    disk.Free();
  }
  EXPECT_EQ(refused, 2);

  // Space is back: every upload goes on where it was, and what was put off ends well.
  for (int number = 1; number < kSessions; ++number) {
    ASSERT_THAT(GoOn(robot, Id('a', number), AnyDrive(number)), IsOk());
  }
  for (int number = 1; number < kSessions; ++number) {
    const v1::Session session = robot.Watch("street", Id('a', number));
    EXPECT_EQ(session.state(), v1::SESSION_STATE_COMMITTED) << session.id() << ": " << session.reason();
  }
  v1::Map map;
  ASSERT_THAT(robot.GetMap("street", map), IsOk());
  EXPECT_EQ(map.sessions(), static_cast<uint64_t>(kSessions));
  EXPECT_THAT(Verify(robot, "street").problems(), IsEmpty());
  daemon.Kill();
  daemon.Start();
  Robot again(daemon.listen());
  EXPECT_THAT(Verify(again, "street").problems(), IsEmpty());
  EXPECT_EQ(Replay(again, "street").different(), 0U);
}

TEST(Faults, ASessionThatMeetsAFullDiskWhileItIsMergedIsPutOffAndNotLost) {
  DaemonProcess daemon;
  ASSERT_EQ(daemon.End(SIGTERM), 0);
  const SmallDisk disk(daemon.data(), "48m");  // too small for what RocksDB would set aside for its log
  if (!disk.mounted()) GTEST_SKIP() << "mounting a small file system needs root";
  daemon.Start();
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  ASSERT_THAT(robot.UploadDrive("street", "a0", AnyDrive(0), true), IsOk());
  disk.Fill(0);  // while it is aligned, most likely; if it was faster, the next one meets it
  Sleep(1500);
  v1::Session session;
  ASSERT_THAT(robot.GetSession("street", "a0", session), IsOk());
  EXPECT_NE(session.state(), v1::SESSION_STATE_FAILED) << session.reason();
  disk.Free();
  EXPECT_EQ(robot.Watch("street", "a0").state(), v1::SESSION_STATE_COMMITTED);
  EXPECT_THAT(Verify(robot, "street").problems(), IsEmpty());
}

// Flips a bit in the middle of the value that a block of the map has in a blob file. False if there is none.
bool DamageABlock(const std::string& data, const VoxelIndex& block) {
  std::string key(8, '\0');
  auto rest = static_cast<uint64_t>(BlockKeyOf(block));
  for (char& byte : key) {
    byte = static_cast<char>(rest);
    rest >>= 8;
  }
  for (const auto& file : fs::directory_iterator(data + "/rocksdb")) {
    if (file.path().extension() != ".blob") continue;
    std::ifstream in(file.path(), std::ios::binary);
    std::ostringstream content;
    content << in.rdbuf();
    std::string bytes = content.str();
    for (size_t at = bytes.find(key); at != std::string::npos; at = bytes.find(key, at + 1)) {
      if (at < 6 || bytes[at - 6] != 'B' || bytes[at - 5] != 1) continue;  // see storage/block_codec.h
      bytes[at + 100] = static_cast<char>(bytes[at + 100] ^ 4);
      std::ofstream(file.path(), std::ios::binary) << bytes;
      return true;
    }
  }
  return false;
}

TEST(Faults, ADamagedBlockIsDataLossTheRestIsReadAndARestoredCopyIsWhole) {
  const TemporaryDirectory directory;
  DaemonProcess daemon;
  const VoxelIndex damaged{1, 0, -1};
  std::string before;
  {
    Robot robot(daemon.listen());
    ASSERT_THAT(robot.CreateMap("street"), IsOk());
    ASSERT_THAT(robot.UploadDrive("street", "a0", AnyDrive(0), true), IsOk());
    ASSERT_EQ(robot.Watch("street", "a0").state(), v1::SESSION_STATE_COMMITTED);
    before = BytesOf(robot.Tiles("street", true));
    v1::BackupRequest backup;
    backup.set_directory(directory.path() + "/backup");
    v1::BackupResponse made;
    ASSERT_THAT(robot.admin().Backup(Robot::Call().get(), backup, &made), IsOk());
  }
  // To another disk: where it was made, it shares its files with the store.
  fs::copy(directory.path() + "/backup", directory.path() + "/elsewhere", fs::copy_options::recursive);
  // A start writes what was only in the log into files.
  daemon.Kill();
  daemon.Start();
  ASSERT_EQ(daemon.End(SIGTERM), 0);
  ASSERT_TRUE(DamageABlock(daemon.data(), damaged));
  daemon.Start();

  Robot robot(daemon.listen());
  v1::StreamTilesRequest everything;
  everything.set_map("street");
  everything.set_include_all(true);
  const auto call = Robot::Call();
  const auto stream = robot.tiles().StreamTiles(call.get(), everything);
  for (v1::StreamTilesResponse part; stream->Read(&part);) continue;
  EXPECT_THAT(stream->Finish(), FailsWith(grpc::StatusCode::DATA_LOSS, {"(1, 0, -1)"}));
  // 6.4 m a block: a box that leaves the damaged one out.
  v1::Box elsewhere;
  elsewhere.mutable_min()->set_x(-40);
  elsewhere.mutable_min()->set_y(-40);
  elsewhere.mutable_min()->set_z(-10);
  elsewhere.mutable_max()->set_x(-1);
  elsewhere.mutable_max()->set_y(-1);
  elsewhere.mutable_max()->set_z(10);
  EXPECT_FALSE(robot.Tiles("street", true, &elsewhere).empty());
  const v1::VerifyMapResponse verified = Verify(robot, "street");
  EXPECT_EQ(verified.problem_count(), 1U);
  EXPECT_THAT(verified.problems(), testing::Contains(testing::HasSubstr("(1, 0, -1)")));

  // A session that needs the block fails and says so; the map stays as it is.
  ASSERT_THAT(robot.UploadDrive("street", "a1", AnyDrive(1), true), IsOk());
  const v1::Session failed = robot.Watch("street", "a1");
  EXPECT_EQ(failed.state(), v1::SESSION_STATE_FAILED);
  EXPECT_THAT(failed.reason(), testing::HasSubstr("(1, 0, -1)"));

  v1::RestoreRequest restore;
  restore.set_directory(directory.path() + "/elsewhere");
  restore.set_map("street");
  restore.set_as("copy");
  v1::RestoreResponse restored;
  ASSERT_THAT(robot.admin().Restore(Robot::Call().get(), restore, &restored), IsOk());
  EXPECT_EQ(BytesOf(robot.Tiles("copy", true)), before);
  EXPECT_THAT(Verify(robot, "copy").problems(), IsEmpty());
}

}  // namespace
}  // namespace mapkeep
