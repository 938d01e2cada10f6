#pragma once

#include <string>

namespace stipple::cli {

/// "1:23", or "2:01:23" from an hour on.
std::string timeText(double seconds);

/// What the user sees of work that says more than how far it is: a bar with a line on a terminal,
/// else a line at each stage and tenth.
class StatusLine {
 public:
  StatusLine();
  /// In: done, 0..1.
  void show(double done, const std::string& stage, const std::string& line);
  /// Before anything else is printed.
  void clear();

 private:
  bool is_terminal_;
  bool is_drawn_ = false;
  int tenth_ = -1;
  std::string stage_;
};

}  // namespace stipple::cli
