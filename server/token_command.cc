#include "server/token_command.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <vector>

#include "server/auth/token_table.h"

namespace mapkeep {
namespace {

// One write to the end of the file, readable by its owner alone if it is new: a daemon that reads meanwhile sees all of
// the line or nothing. A last line without an end gets one.
absl::Status Append(const std::string& file, const std::string& line) {
  const int out = open(file.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  if (out < 0) return absl::UnavailableError(absl::StrCat("--append ", file, ": ", std::strerror(errno)));
  char last = '\n';
  if (const off_t size = lseek(out, 0, SEEK_END); size > 0 && pread(out, &last, 1, size - 1) != 1) last = '\n';
  const std::string text = absl::StrCat(last == '\n' ? "" : "\n", line, "\n");
  const bool written = write(out, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(out) == 0;
  const int error = errno;
  close(out);
  if (written) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat("--append ", file, ": ", std::strerror(error)));
}

}  // namespace

absl::StatusOr<std::string> MakeToken(int argc, const char* const* argv) {
  CLI::App app("Makes a token and its line for the file of --tokens.", "mapkeepd token");
  std::string name, file;
  std::vector<std::string> roles, maps;
  app.add_option("NAME", name, "Of the robot or person: a robot's sessions carry it")->required();
  app.add_option("--role", roles, "robot, reader or operator; may be given several times")
      ->required()
      ->delimiter(',')
      ->type_name("ROLE");
  app.add_option("--map", maps, "A map, the beginning of names followed by '*', or '*' for every map")
      ->required()
      ->delimiter(',')
      ->type_name("MAP");
  app.add_option("--append", file, "Write the line to the end of this file")->type_name("FILE");
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {  // the library's way to report; it goes no further
    return app.help();
  } catch (const CLI::ParseError& error) {
    return absl::InvalidArgumentError(absl::StrCat(error.what(), " (mapkeepd token --help)"));
  }
  const auto token = NewToken();
  if (!token.ok()) return token.status();
  const auto line = TokenLine(name, roles, maps, *token);
  if (!line.ok()) return line.status();
  if (file.empty()) return absl::StrCat(*token, "\n", *line, "\n");
  if (absl::Status status = Append(file, *line); !status.ok()) return status;
  return absl::StrCat(*token, "\n");
}

}  // namespace mapkeep
