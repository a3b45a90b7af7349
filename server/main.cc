#include <malloc.h>
#include <pthread.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <string>
#include <string_view>
#include <thread>
#include <variant>

#include "server/command_line.h"
#include "server/daemon.h"
#include "server/log.h"
#include "server/token_command.h"

namespace {

constexpr int kCannotServe = 1;
constexpr int kBadConfiguration = 2;

constexpr int kLargestOfHeaps = 32 << 20;  // bytes; the most that glibc takes
constexpr int kNeverByItself = 1 << 30;    // bytes at the end of a heap that are given back; SpareMemory does that
constexpr int kGrowth = 4 << 20;           // bytes by which a heap grows at least

// glibc gives every thread a heap of its own, up to eight a core, and what one of them let go of is of no use to the
// others: with scans of megabytes going through dozens of threads, most of the daemon's memory was free and resident.
// It also asks the system for more and gives it back with every other chunk of a scan, and meanwhile nobody touches
// new memory: threads that answer waited for one that had given way in the midst of it. Before any thread is started.
void ShareHeaps() {
  mallopt(M_ARENA_MAX, static_cast<int>(2 * std::max(1U, std::thread::hardware_concurrency())));
  mallopt(M_MMAP_THRESHOLD, kLargestOfHeaps);
  mallopt(M_TRIM_THRESHOLD, kNeverByItself);
  mallopt(M_TOP_PAD, kGrowth);
}

// mapkeepd token ...
int PrintToken(int argc, char** argv) {
  const auto text = mapkeep::MakeToken(argc, argv);
  if (!text.ok()) {
    std::fprintf(stderr, "mapkeepd token: %s\n", std::string(text.status().message()).c_str());
    return absl::IsInvalidArgument(text.status()) ? kBadConfiguration : kCannotServe;
  }
  std::fputs(text->c_str(), stdout);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "token") return PrintToken(argc - 1, argv + 1);
  const auto command = mapkeep::ReadCommandLine(argc, argv);
  if (!command.ok()) {
    std::fprintf(stderr, "mapkeepd: %s\n", std::string(command.status().message()).c_str());
    return kBadConfiguration;
  }
  if (const auto* leave = std::get_if<mapkeep::PrintAndLeave>(&*command)) {
    std::fputs(leave->text.c_str(), stdout);
    return 0;
  }
  const auto& config = std::get<mapkeep::Config>(*command);
  ShareHeaps();
  mapkeep::StartLogging(config.log_format);

  // Blocked in every thread that starts from here on, and waited for in this one.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);

  auto daemon = mapkeep::Daemon::Start(config);
  if (!daemon.ok()) {
    mapkeep::LogError("cannot serve", {{"why", std::string(daemon.status().message())}});
    return kCannotServe;
  }
  int signal = 0;
  sigwait(&signals, &signal);
  mapkeep::LogInfo("signal", {{"number", signal}});
  // Whoever asks a second time does not want to wait for good order.
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  (*daemon)->Stop();
  return 0;
}
