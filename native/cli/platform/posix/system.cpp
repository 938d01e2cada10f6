#include "cli/platform/system.h"

#include <signal.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "cli/library.h"

namespace stipple::cli {

std::vector<std::string> wordsOf(int argc, char** argv) {
  return {argv, argv + argc};
}

bool isTerminal() {
  return isatty(STDERR_FILENO) != 0;
}

bool isWritable(const std::string& folder) {
  return access(folder.c_str(), W_OK) == 0;
}

std::string newTemporaryFolder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "stipple-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) {
    throw Failure("'" + pattern + "' cannot be made: " + std::strerror(errno));
  }
  return pattern;
}

void onSignals(void (*note)(int number)) {
  struct sigaction action = {};
  action.sa_handler = note;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);  // a macro on macOS, where :: before it is an error
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before = {};
    ::sigaction(number, nullptr, &before);
    if (number == SIGHUP && before.sa_handler == SIG_IGN) continue;
    ::sigaction(number, &action, nullptr);
  }
}

const char* signalName(int number) {
  return number == SIGINT ? "Ctrl-C" : number == SIGTERM ? "SIGTERM" : "SIGHUP";
}

void endBy(int number) {
  ::signal(number, SIG_DFL);
  ::raise(number);
}

long secondsNow() {
  timespec time{};
  ::clock_gettime(CLOCK_MONOTONIC, &time);
  return time.tv_sec;
}

void ignoreClosedPipes() {
  ::signal(SIGPIPE, SIG_IGN);
}

}  // namespace stipple::cli
