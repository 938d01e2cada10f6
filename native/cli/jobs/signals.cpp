#include "cli/jobs/signals.h"

#include <signal.h>

#include <ctime>
#include <string>

namespace stipple::cli {

namespace {

constexpr time_t kPatienceSeconds = 2;

volatile sig_atomic_t g_noted = 0;
/// When it came, seconds. Written before g_noted, and by the first handler alone.
volatile time_t g_noted_at = 0;
int g_hold_count = 0;

time_t now() {
  timespec time{};
  ::clock_gettime(CLOCK_MONOTONIC, &time);
  return time.tv_sec;
}

/// Two signals at once are one: a terminal that closes sends SIGHUP, and its shell may add SIGTERM.
void note(int number) {
  if (g_noted == 0) {
    g_noted_at = now();
    g_noted = number;
  } else if (now() - g_noted_at >= kPatienceSeconds) {
    ::signal(number, SIG_DFL);
    ::raise(number);
  }
}

const char* nameOf(int number) {
  return number == SIGINT ? "Ctrl-C" : number == SIGTERM ? "SIGTERM" : "SIGHUP";
}

}  // namespace

Interrupted::Interrupted(int number)
    : std::runtime_error(std::string("stopped by ") + nameOf(number)), signal(number) {}

void listenForSignals() {
  struct sigaction action = {};
  action.sa_handler = note;
  action.sa_flags = SA_RESTART;
  ::sigemptyset(&action.sa_mask);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before = {};
    ::sigaction(number, nullptr, &before);
    if (number == SIGHUP && before.sa_handler == SIG_IGN) continue;
    ::sigaction(number, &action, nullptr);
  }
}

int notedSignal() {
  return g_noted;
}

void throwIfInterrupted() {
  if (g_hold_count == 0 && g_noted != 0) throw Interrupted(g_noted);
}

SignalHold::SignalHold() : is_outermost_(g_hold_count == 0) {
  ++g_hold_count;
}

SignalHold::~SignalHold() {
  --g_hold_count;
}

}  // namespace stipple::cli
