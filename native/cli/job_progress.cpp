#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <string>
#include <thread>

#include "cli/library.h"

namespace stipple::cli {

namespace {

constexpr int kBarWidth = 30;
constexpr auto kPollInterval = std::chrono::milliseconds(20);
constexpr auto kQuietTime = std::chrono::milliseconds(500);

volatile std::sig_atomic_t g_interrupted = 0;

void interrupt(int) {
  g_interrupted = 1;
}

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
  const auto previous = std::signal(SIGINT, interrupt);
  std::string stage;
  auto progress = sized<StippleJobProgress>();
  bool drawn = false;
  for (;;) {
    check(stipple_job_poll(job.get(), &progress));
    if (progress.state != STIPPLE_JOB_RUNNING) break;
    if (g_interrupted) check(stipple_job_cancel(job.get()));
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
  std::signal(SIGINT, previous);
  if (drawn) std::fprintf(stderr, "\r%*s\r", kBarWidth + 52, "");
  check(stipple_job_wait(job.get()));
}

}  // namespace stipple::cli
