#include "client/cli/interruption.h"

#include <csignal>

namespace mapkeep {
namespace {

volatile std::sig_atomic_t requested_signal = 0;

void Note(int signal) { requested_signal = signal; }

}  // namespace

Interruption::Interruption() {
  requested_signal = 0;
  struct sigaction action = {};
  action.sa_handler = Note;
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // the second signal meets the default
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

Interruption::~Interruption() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

bool Interruption::requested() const { return requested_signal != 0; }

}  // namespace mapkeep
