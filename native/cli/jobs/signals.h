#pragma once

#include <stdexcept>

namespace stipple::cli {

/// Ctrl-C, SIGTERM or SIGHUP (unless nohup has it ignored) has ended the tool before there was
/// anything to keep.
struct Interrupted : std::runtime_error {
  explicit Interrupted(int number);
  int signal;
};

/// From here on signals are noted instead of ending the tool: what is being read or written is read
/// or written to its end. Where one has waited for 2 s, the next ends the tool at once.
void listenForSignals();

/// The first signal that came, 0 for none.
int notedSignal();

/// Throws Interrupted where a signal came, unless they are held.
void throwIfInterrupted();

/// While it lives throwIfInterrupted() does nothing: whoever holds signals looks at notedSignal().
class SignalHold {
 public:
  SignalHold();
  ~SignalHold();
  SignalHold(const SignalHold&) = delete;
  SignalHold& operator=(const SignalHold&) = delete;
  /// Whether nobody further out holds them, so that a signal is to be obeyed here.
  bool isOutermost() const { return is_outermost_; }

 private:
  bool is_outermost_;
};

}  // namespace stipple::cli
