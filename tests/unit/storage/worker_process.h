#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace mapkeep {

/// A running crash_worker, which commits sessions until it is killed or done.
class WorkerProcess final {
 public:
  explicit WorkerProcess(const std::vector<std::string>& arguments) {
    std::vector<std::string> words = {
        (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "crash_worker").string()};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    std::array<int, 2> ends{};
    EXPECT_EQ(::pipe(ends.data()), 0);
    output_ = ends[0];
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_addclose(&actions, ends[0]);
    posix_spawn_file_actions_addclose(&actions, ends[1]);
    EXPECT_EQ(::posix_spawn(&process_, words[0].c_str(), &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
  }
  /// kill -9 if nobody waited for its end.
  ~WorkerProcess() {
    if (process_ > 0) {
      Signal(SIGKILL);
      Wait();
    }
    ::close(output_);
  }
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  /// The next session acknowledged, or nothing when the worker has ended.
  std::optional<int> NextAcknowledged() {
    std::string line;
    char byte = 0;
    while (::read(output_, &byte, 1) == 1) {
      if (byte == '\n') return std::stoi(line);
      line.push_back(byte);
    }
    return std::nullopt;
  }

  void Signal(int signal) { ::kill(process_, signal); }

  /// The exit status, as waitpid gives it.
  int Wait() {
    int status = 0;
    EXPECT_EQ(::waitpid(process_, &status, 0), process_);
    process_ = 0;
    return status;
  }

 private:
  pid_t process_ = 0;
  int output_ = -1;
};

}  // namespace mapkeep
