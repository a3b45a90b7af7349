#include "tests/integration/daemon_process.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kGlance{10};
constexpr int kMostGlances = 6000;  // a minute

std::string Content(const std::string& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

pid_t Spawn(const std::vector<std::string>& flags, const std::string& log) {
  std::vector<std::string> words = {MAPKEEPD};
  words.insert(words.end(), flags.begin(), flags.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  const pid_t process = fork();
  if (process == 0) {
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    execv(MAPKEEPD, argv.data());
    _exit(127);
  }
  close(out);
  return process;
}

int StatusOf(int wait_status) { return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : -1; }

}  // namespace

TemporaryDirectory::TemporaryDirectory() {
  std::string pattern = (fs::temp_directory_path() / "mapkeep-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary directory");
  path_ = pattern;
}

TemporaryDirectory::~TemporaryDirectory() {
  std::error_code error;
  fs::remove_all(path_, error);
}

ProgramEnd RunDaemon(const std::vector<std::string>& flags) {
  const TemporaryDirectory directory;
  const std::string log = directory.path() + "/log";
  const pid_t process = Spawn(flags, log);
  for (int glance = 0; glance < kMostGlances; ++glance) {
    int status = 0;
    if (waitpid(process, &status, WNOHANG) == process) return {StatusOf(status), Content(log)};
    std::this_thread::sleep_for(kGlance);
  }
  kill(process, SIGKILL);
  waitpid(process, nullptr, 0);
  return {-1, "did not end:\n" + Content(log)};
}

DaemonProcess::DaemonProcess(std::vector<std::string> flags) : flags_(std::move(flags)) { Start(); }

DaemonProcess::~DaemonProcess() {
  if (process_ > 0) Kill();
}

void DaemonProcess::Start() {
  const std::string ports = directory_.path() + "/ports.json";
  fs::remove(ports);
  std::vector<std::string> flags = {"--data",  data(),        "--listen",     "127.0.0.1:0",
                                    "--admin", "127.0.0.1:0", "--ports-file", ports};
  flags.insert(flags.end(), flags_.begin(), flags_.end());
  process_ = Spawn(flags, directory_.path() + "/log");
  for (int glance = 0; glance < kMostGlances && !fs::exists(ports); ++glance) {
    if (!is_running()) break;
    std::this_thread::sleep_for(kGlance);
  }
  if (!fs::exists(ports)) throw std::runtime_error("mapkeepd did not start:\n" + log());
  const auto where = nlohmann::json::parse(Content(ports));
  listen_ = where.at("listen");
  admin_ = where.at("admin");
}

void DaemonProcess::Kill() { End(SIGKILL); }

void DaemonProcess::Signal(int signal) const { kill(process_, signal); }

int DaemonProcess::End(int signal) {
  kill(process_, signal);
  int status = 0;
  waitpid(process_, &status, 0);
  process_ = -1;
  return StatusOf(status);
}

std::string DaemonProcess::data() const { return directory_.path() + "/data"; }

std::string DaemonProcess::log() const { return Content(directory_.path() + "/log"); }

bool DaemonProcess::is_running() const {
  siginfo_t info{};
  return process_ > 0 && waitid(P_PID, process_, &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid == 0;
}

}  // namespace mapkeep
