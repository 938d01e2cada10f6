#include "base/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cfenv>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <utility>
#include <vector>

#ifdef STIPPLE_SANITIZE_THREADS
extern "C" void __tsan_acquire(void* address);
extern "C" void __tsan_release(void* address);
#endif

namespace stipple {

namespace {

#ifdef STIPPLE_SANITIZE_THREADS
void acquire(char* place) {
  __tsan_acquire(place);
}
void release(char* place) {
  __tsan_release(place);
}
#else
void acquire(char*) {}
void release(char*) {}
#endif

/// Tells the thread sanitizer what oneTBB, which is not built with it, guarantees of a loop: what
/// the caller did before is seen by each range, and what the ranges did by the caller afterwards.
/// Of two ranges it says nothing, so that a race between them is found.
class LoopOrder {
 public:
  LoopOrder() { release(&before_); }
  ~LoopOrder() { acquire(&after_); }
  LoopOrder(const LoopOrder&) = delete;
  LoopOrder& operator=(const LoopOrder&) = delete;

  class Range {
   public:
    explicit Range(LoopOrder& order) : order_(order) { acquire(&order_.before_); }
    ~Range() { release(&order_.after_); }
    Range(const Range&) = delete;
    Range& operator=(const Range&) = delete;

   private:
    LoopOrder& order_;
  };

 private:
  char before_ = 0, after_ = 0;
};

/// Arenas that nobody works in, by their number of threads. oneTBB 2021 keeps 7 to 12 KB of each
/// arena that has ever been made, so that arenas are lent and come back. There are as many as have
/// worked at the same time: two jobs never share one, since the second would wait for a free slot.
class ArenaStore {
 public:
  /// Lives as long as the process: a job may still run in an arena when static objects are
  /// destroyed, and gives it back here.
  static ArenaStore& instance() {
    static ArenaStore& store = *new ArenaStore;
    return store;
  }

  std::unique_ptr<tbb::task_arena> take(int thread_count) {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      auto& idle = idle_[thread_count];
      if (!idle.empty()) {
        std::unique_ptr<tbb::task_arena> arena = std::move(idle.back());
        idle.pop_back();
        return arena;
      }
    }
    return std::make_unique<tbb::task_arena>(thread_count);
  }

  void giveBack(int thread_count, std::unique_ptr<tbb::task_arena> arena) {
    std::lock_guard<std::mutex> lock(mutex_);
    idle_[thread_count].push_back(std::move(arena));
  }

 private:
  std::mutex mutex_;
  std::unordered_map<int, std::vector<std::unique_ptr<tbb::task_arena>>> idle_;
};

/// An arena for the time of one call.
class LentArena {
 public:
  explicit LentArena(int thread_count)
      : thread_count_(thread_count), arena_(ArenaStore::instance().take(thread_count)) {}
  ~LentArena() { ArenaStore::instance().giveBack(thread_count_, std::move(arena_)); }
  LentArena(const LentArena&) = delete;
  LentArena& operator=(const LentArena&) = delete;
  tbb::task_arena& operator*() { return *arena_; }

 private:
  int thread_count_;
  std::unique_ptr<tbb::task_arena> arena_;
};

}  // namespace

void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) {
  if (count == 0) return;
  const size_t ranges = rangeCount(count, grain);
  if (ranges == 1) {
    body(0, count);
    return;
  }
  // The threads of an arena would calculate with its own floating-point settings.
  tbb::task_group_context context(
      tbb::task_group_context::bound,
      tbb::task_group_context::default_traits | tbb::task_group_context::fp_settings);
  LoopOrder order;
  tbb::parallel_for(
      tbb::blocked_range<size_t>(0, ranges, 1),
      [&](const tbb::blocked_range<size_t>& range) {
        const LoopOrder::Range seen(order);
        for (size_t i = range.begin(); i < range.end(); ++i) {
          body(i * grain, std::min(count, (i + 1) * grain));
        }
      },
      tbb::simple_partitioner(), context);
}

size_t threadLimit() {
  return static_cast<size_t>(std::max(1, tbb::this_task_arena::max_concurrency()));
}

void withThreads(unsigned thread_count, const std::function<void()>& body) {
  LentArena arena(thread_count == 0 ? tbb::task_arena::automatic : static_cast<int>(thread_count));
  // An arena has the floating-point settings of the thread that first used it, whoever that was: an
  // application's threads may flush small numbers to 0.
  std::fenv_t settings;
  std::fegetenv(&settings);
  // Isolated: a thread that waits for this work must not pick up tasks of the application (Cycles
  // shares the process-wide pool) and stay away for seconds.
  (*arena).execute([&] {
    std::fesetenv(&settings);
    tbb::this_task_arena::isolate(body);
  });
}

}  // namespace stipple
