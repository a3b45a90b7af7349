#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace mapkeep {

/// A directory that goes with this.
class TemporaryDirectory {
 public:
  TemporaryDirectory();
  ~TemporaryDirectory();
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// How a program ended.
struct ProgramEnd {
  int status = -1;     ///< exit status; -1 if a signal ended it
  std::string output;  ///< standard error
};

/// Runs mapkeepd to its end, which must come within a minute.
ProgramEnd RunDaemon(const std::vector<std::string>& flags);

/// A real mapkeepd in a child process, on free ports. Start again after an end: it goes on with the same data.
class DaemonProcess {
 public:
  /// Starts it and waits until it serves; throws std::runtime_error with its log if it does not.
  explicit DaemonProcess(std::vector<std::string> flags = {});
  /// kill -9 if it still runs.
  ~DaemonProcess();
  DaemonProcess(const DaemonProcess&) = delete;
  DaemonProcess& operator=(const DaemonProcess&) = delete;

  void Start();
  /// kill -9.
  void Kill();
  /// Sends a signal that does not end it.
  void Signal(int signal) const;
  /// Sends the signal; gives the exit status, or -1 if a signal ended it.
  int End(int signal);

  const std::string& listen() const { return listen_; }  ///< HOST:PORT of gRPC
  const std::string& admin() const { return admin_; }    ///< HOST:PORT of HTTP
  std::string data() const;
  std::string log() const;
  bool is_running() const;

 private:
  std::vector<std::string> flags_;
  TemporaryDirectory directory_;
  pid_t process_ = -1;
  std::string listen_, admin_;
};

}  // namespace mapkeep
