#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <string>
#include <thread>

#include "cli/library.h"

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

}  // namespace

void finish(const Job& job) {
  const bool terminal = isatty(STDERR_FILENO) != 0;
  const auto start = std::chrono::steady_clock::now();
  const SignalHold hold;
  std::string stage;
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
      } else if (stage != progress.stage) {
        stage = progress.stage;
        std::fprintf(stderr, "%s\n", progress.stage);
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
