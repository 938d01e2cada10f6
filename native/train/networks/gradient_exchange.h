#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace stipple {

/// How several processes take the steps of one training together: each finds the derivatives of a
/// share of the examples, and all add them up. All call the same functions in the same order, and
/// each returns when all have called it.
class GradientExchange {
 public:
  virtual ~GradientExchange() = default;
  virtual size_t rank() const = 0;  ///< of this process, 0 to size() - 1; 0 leads
  virtual size_t size() const = 0;
  /// Replaces numbers [n] by their sums over all ranks: in double, in the order of ranks, and so
  /// the same bits on all. Errors: kUnavailable where another process is gone; kCancelled.
  virtual void sum(std::span<float> numbers) = 0;
  virtual void sum(std::span<double> numbers) = 0;
  /// Gives all ranks the numbers [n] of rank 0. Errors: as sum().
  virtual void share(std::span<float> numbers) = 0;
};

/// Of a process that learns alone.
std::shared_ptr<GradientExchange> noExchange();

/// A number that differs, very likely, where any of the values does.
uint64_t fingerprintOf(std::span<const float> values);

/// Errors: kInvalidArgument on at least one rank where not all have the same fingerprint; `what`
/// they are of, as "the collections", is in its message.
void requireSame(GradientExchange& exchange, uint64_t fingerprint, const char* what);

/// Errors: kInvalidArgument where some rank would have no example in a step. In: part, as "part 2".
void requireExamples(const GradientExchange& exchange, size_t batch, const char* part);

/// Which of a step's `batch` examples this process has: those from its rank on, in steps of as many
/// as there are processes.
std::vector<size_t> ownExamples(const GradientExchange& exchange, size_t batch);

/// What ranks found of their examples becomes that of the step. In: weights that they had. Errors:
/// requireSame() of the weights, which drift apart where processors round differently.
void sumStep(GradientExchange& exchange, std::span<const float> weights, std::span<float> gradients,
             std::span<double> losses);

}  // namespace stipple
