#include "server/background.h"

#include <linux/sched.h>
#include <linux/sched/types.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>

namespace mapkeep {
namespace {

constexpr int kNice = 10;                     // a tenth of the weight of a thread at 0, where both want the processor
constexpr uint64_t kShortestSlice = 100'000;  // nanoseconds: the least that the kernel takes
// Whoever moves bytes wakes those that make answers, often on its own processor, and would otherwise keep them waiting
// for as long as there are more bytes.
constexpr uint64_t kMovingSlice = 150'000;
// Whoever has given way still gets its turn now and then, and keeps the processor for one slice then: the kernel's own
// is of some milliseconds.
constexpr uint64_t kBackgroundSlice = 200'000;

// On Linux this is of the thread, not the process. A slice of 0 is the kernel's own; a shorter one comes sooner, and
// interrupts a longer one when its thread wakes. Refused or unknown: things stay as they are, which is no error.
void Schedule(int policy, int nice, uint64_t slice) {
  sched_attr wanted{};
  wanted.size = sizeof wanted;
  wanted.sched_policy = static_cast<uint32_t>(policy);
  wanted.sched_nice = nice;
  wanted.sched_runtime = slice;
  syscall(SYS_sched_setattr, 0, &wanted, 0);
}

}  // namespace

void GiveWay() {
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
  Schedule(SCHED_BATCH, getpriority(PRIO_PROCESS, static_cast<id_t>(gettid())), kBackgroundSlice);
}

void MoveBytes() { Schedule(SCHED_NORMAL, getpriority(PRIO_PROCESS, static_cast<id_t>(gettid())), kMovingSlice); }

void AnswerSoon() { Schedule(SCHED_NORMAL, getpriority(PRIO_PROCESS, static_cast<id_t>(gettid())), kShortestSlice); }

}  // namespace mapkeep
