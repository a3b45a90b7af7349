#include "tests/unit/client/program.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

std::string Contents(const std::string& path) {
  std::ostringstream contents;
  contents << std::ifstream(path).rdbuf();
  return contents.str();
}

std::vector<char*> Pointers(std::vector<std::string>& strings) {
  std::vector<char*> pointers;
  pointers.reserve(strings.size() + 1);
  for (std::string& string : strings) pointers.push_back(string.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

ProgramResult RunMapkeep(const std::vector<std::string>& arguments, const std::vector<std::string>& environment) {
  const TemporaryDirectory directory;
  const std::string out = directory.path() / "out", error = directory.path() / "error";
  std::vector<std::string> command = {MAPKEEP_PROGRAM};
  command.insert(command.end(), arguments.begin(), arguments.end());
  std::vector<std::string> entries = environment;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (std::string(*entry).rfind("MAPKEEP_", 0) != 0) entries.emplace_back(*entry);
  }
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, out.c_str(), O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, error.c_str(), O_WRONLY | O_CREAT, 0600);
  pid_t child = 0;
  const int spawned =
      posix_spawn(&child, MAPKEEP_PROGRAM, &files, nullptr, Pointers(command).data(), Pointers(entries).data());
  posix_spawn_file_actions_destroy(&files);
  EXPECT_EQ(spawned, 0) << MAPKEEP_PROGRAM;
  int status = 0;
  if (spawned != 0 || waitpid(child, &status, 0) != child) return {};
  EXPECT_TRUE(WIFEXITED(status)) << "ended by signal " << WTERMSIG(status);
  return {WEXITSTATUS(status), Contents(out), Contents(error)};
}

}  // namespace mapkeep
