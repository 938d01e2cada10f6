#pragma once

#include <chrono>
#include <utility>

namespace stipple {

/// Measures wall time from where it is made.
class Stopwatch {
 public:
  /// Seconds since it was made.
  double seconds() const { return between(start_, Clock::now()); }

  /// Seconds since the last lap; the first lap begins where the watch was made.
  double lap() {
    const Clock::time_point now = Clock::now();
    return between(std::exchange(lap_, now), now);
  }

 private:
  using Clock = std::chrono::steady_clock;

  static double between(Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double>(to - from).count();
  }

  Clock::time_point start_ = Clock::now();
  Clock::time_point lap_ = start_;
};

/// Adds the seconds of a block to a sum.
class TimedBlock {
 public:
  explicit TimedBlock(double& sum) : sum_(sum) {}
  ~TimedBlock() { sum_ += watch_.seconds(); }
  TimedBlock(const TimedBlock&) = delete;
  TimedBlock& operator=(const TimedBlock&) = delete;

 private:
  double& sum_;
  Stopwatch watch_;
};

}  // namespace stipple
