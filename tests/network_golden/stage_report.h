#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace stipple {

/// How far a number may be from the expected one: absolute + relative * |expected|.
struct StageTolerance {
  double absolute = 0.0;
  double relative = 0.0;
};

/// kTolerances: what is beyond its tolerance fails. kErrors: errors are only told, for networks
/// that are run in fewer bits than were recorded.
enum class StageJudgement { kTolerances, kErrors };

/// Compares what the library computes with what a golden file expects, prints a line for each stage
/// and counts the stages that are beyond their tolerance. Numbers that are not finite and counts
/// that differ fail always.
class StageReport {
 public:
  explicit StageReport(StageJudgement judgement = StageJudgement::kTolerances)
      : judgement_(judgement) {}
  /// In: stage: what the line calls it, usually the expectation's name ("layer0.attn").
  void compare(const std::string& stage, std::span<const float> seen,
               std::span<const float> expected, StageTolerance tolerance);
  /// The same where not a single number may differ.
  void compareExactly(const std::string& stage, std::span<const int64_t> seen,
                      std::span<const int64_t> expected);
  void compareExactly(const std::string& stage, std::span<const uint8_t> seen,
                      std::span<const uint8_t> expected);
  /// A stage that could not be run.
  void failed(const std::string& stage, const std::string& reason);

  StageJudgement judgement() const { return judgement_; }
  size_t stageCount() const { return stage_count_; }
  size_t failureCount() const { return failure_count_; }

 private:
  void print(const std::string& stage, bool passed, const std::string& text);
  template <typename T>
  void compareIntegers(const std::string& stage, std::span<const T> seen,
                       std::span<const T> expected);

  StageJudgement judgement_;
  size_t stage_count_ = 0;
  size_t failure_count_ = 0;
};

}  // namespace stipple
