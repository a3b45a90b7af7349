#include "server/background.h"

#include <sys/resource.h>
#include <unistd.h>

namespace mapkeep {
namespace {

constexpr int kNice = 10;  // a tenth of the weight of a thread at 0, where both want the processor

}  // namespace

void GiveWay() {
  // On Linux this is of the thread, not the process.
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
}

}  // namespace mapkeep
