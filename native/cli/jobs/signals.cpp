#include "cli/jobs/signals.h"

#include <csignal>
#include <string>

#include "cli/platform/system.h"

namespace stipple::cli {

namespace {

constexpr long kPatienceSeconds = 2;

volatile std::sig_atomic_t g_noted = 0;
/// When it came, seconds. Written before g_noted, and by the first handler alone.
volatile long g_noted_at = 0;
int g_hold_count = 0;

/// Two signals at once are one: a terminal that closes sends SIGHUP, and its shell may add SIGTERM.
void note(int number) {
  if (g_noted == 0) {
    g_noted_at = secondsNow();
    g_noted = number;
  } else if (secondsNow() - g_noted_at >= kPatienceSeconds) {
    endBy(number);
  }
}

}  // namespace

Interrupted::Interrupted(int number)
    : std::runtime_error(std::string("stopped by ") + signalName(number)), signal(number) {}

void listenForSignals() {
  onSignals(note);
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
