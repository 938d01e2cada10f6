#include "cli/jobs/status_line.h"

#include <algorithm>
#include <cstdio>

#include "cli/platform/system.h"

namespace stipple::cli {

namespace {

constexpr int kBarWidth = 24;

}  // namespace

std::string timeText(double seconds) {
  const auto whole = static_cast<long>(std::max(0.0, seconds) + 0.5);
  char text[48];
  if (whole >= 3600) {
    std::snprintf(text, sizeof(text), "%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
  } else {
    std::snprintf(text, sizeof(text), "%ld:%02ld", whole / 60, whole % 60);
  }
  return text;
}

StatusLine::StatusLine() : is_terminal_(isTerminal()) {}

void StatusLine::show(double done, const std::string& stage, const std::string& line) {
  if (is_terminal_) {
    const auto full = static_cast<size_t>(done * kBarWidth);
    std::fprintf(stderr, "\r[%s%s] %s\033[K", std::string(full, '#').c_str(),
                 std::string(kBarWidth - full, ' ').c_str(), line.c_str());
    std::fflush(stderr);
    is_drawn_ = true;
    return;
  }
  const int tenth = static_cast<int>(done * 10);
  if (tenth == tenth_ && stage == stage_) return;
  tenth_ = tenth;
  stage_ = stage;
  std::fprintf(stderr, "%s\n", line.c_str());
}

void StatusLine::clear() {
  if (is_drawn_) std::fprintf(stderr, "\r\033[K");
  is_drawn_ = false;
}

}  // namespace stipple::cli
