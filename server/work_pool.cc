#include "server/work_pool.h"

#include <utility>

#include "server/background.h"

namespace mapkeep {

WorkPool::WorkPool(int threads, bool background) {
  for (int i = 0; i < threads; ++i) {
    threads_.emplace_back([this, background] {
      background ? GiveWay() : AnswerSoon();
      Run();
    });
  }
}

WorkPool::~WorkPool() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  threads_.clear();  // joins
}

void WorkPool::Submit(std::function<void()> work) {
  {
    const std::lock_guard lock(mutex_);
    waiting_.push_back({std::move(work), std::chrono::steady_clock::now()});
  }
  changed_.notify_one();
}

WorkPoolStatus WorkPool::Status() const {
  const std::lock_guard lock(mutex_);
  WorkPoolStatus status{.waiting = waiting_.size(), .at_work = at_work_, .done = done_};
  if (!waiting_.empty()) {
    status.oldest_seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - waiting_.front().submitted).count();
  }
  return status;
}

void WorkPool::Run() {
  while (true) {
    std::function<void()> work;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return ending_ || !waiting_.empty(); });
      if (waiting_.empty()) return;
      work = std::move(waiting_.front().work);
      waiting_.pop_front();
      ++at_work_;
    }
    work();
    work = nullptr;  // what it held goes before it counts as done
    const std::lock_guard lock(mutex_);
    --at_work_;
    ++done_;
  }
}

}  // namespace mapkeep
