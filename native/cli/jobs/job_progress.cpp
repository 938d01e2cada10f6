#include <chrono>
#include <cstdio>
#include <set>
#include <string>
#include <thread>

#include "cli/library.h"
#include "cli/platform/system.h"

namespace stipple::cli {

namespace {

constexpr int kBarWidth = 30;
constexpr auto kPollInterval = std::chrono::milliseconds(20);
constexpr auto kQuietTime = std::chrono::milliseconds(500);

void drawBar(const StippleJobProgress& progress) {
  const int full = static_cast<int>(progress.fraction * kBarWidth);
  std::fprintf(stderr, "\r[%s%s] %3d %%  %-40.40s",
               std::string(static_cast<size_t>(full), '#').c_str(),
               std::string(static_cast<size_t>(kBarWidth - full), ' ').c_str(),
               static_cast<int>(progress.fraction * 100), progress.stage);
  std::fflush(stderr);
}

/// What a log file gets: each stage once in every tenth of the work. Renders of many samples go
/// back and forth between two stages hundreds of times.
class StageLog {
 public:
  void show(const StippleJobProgress& progress) {
    const int tenth = static_cast<int>(progress.fraction * 10);
    if (tenth != tenth_) said_.clear();
    tenth_ = tenth;
    if (!said_.insert(progress.stage).second) return;
    std::fprintf(stderr, "%3d %%  %s\n", static_cast<int>(progress.fraction * 100), progress.stage);
  }

 private:
  int tenth_ = -1;
  std::set<std::string> said_;
};

}  // namespace

void finish(const Job& job) {
  const bool terminal = isTerminal();
  const auto start = std::chrono::steady_clock::now();
  const SignalHold hold;
  StageLog log;
  auto progress = sized<StippleJobProgress>();
  bool drawn = false;
  for (;;) {
    check(stipple_job_poll(job.get(), &progress));
    if (progress.state != STIPPLE_JOB_RUNNING) break;
    if (hold.isOutermost() && notedSignal() != 0) check(stipple_job_cancel(job.get()));
    if (std::chrono::steady_clock::now() - start > kQuietTime) {
      if (terminal) {
        drawBar(progress);
        drawn = true;
      } else {
        log.show(progress);
      }
    }
    std::this_thread::sleep_for(kPollInterval);
  }
  if (drawn) std::fprintf(stderr, "\r%*s\r", kBarWidth + 52, "");
  const StippleStatus status = stipple_job_wait(job.get());
  if (status == STIPPLE_ERROR_CANCELLED) throw Interrupted(notedSignal());
  check(status);
}

}  // namespace stipple::cli
