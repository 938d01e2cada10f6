#pragma once

#include <atomic>
#include <mutex>
#include <string>

namespace stipple {

/// Progress and cancellation of one long piece of work; every member may be called by any thread.
/// Algorithms take `Progress*` (nullptr: nobody listens) and call `advance` at least ten times a
/// second of work; `advance` throws Error{kCancelled} once `cancel` has been called.
class Progress {
 public:
  /// In: fraction of the whole work that is done, 0..1; stage: short English text for the user.
  void advance(double fraction, const char* stage);
  /// From now on, 0..1 of what advance is told means begin..end of the whole: for work that is made
  /// of several pieces. Not while a piece runs.
  void enterPart(double begin, double end) {
    part_begin_.store(begin, std::memory_order_relaxed);
    part_size_.store(end - begin, std::memory_order_relaxed);
  }
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  /// Throws Error{kCancelled} if `cancel` has been called.
  void throwIfCancelled() const;
  double fraction() const { return fraction_.load(std::memory_order_relaxed); }
  std::string stage() const;

 private:
  std::atomic<bool> cancelled_{false};
  std::atomic<double> fraction_{0.0};
  std::atomic<double> part_begin_{0.0}, part_size_{1.0};
  mutable std::mutex mutex_;
  std::string stage_;
};

/// `progress->advance(...)` where progress may be null.
void advance(Progress* progress, double fraction, const char* stage);

}  // namespace stipple
