#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

namespace stipple {

/// How many of `count` examples are worked on at the same time here: one on each thread.
size_t examplesAtOnce(size_t count);

/// Adds up what the examples of a step say of the weights.
class ExampleGradients {
 public:
  /// In: add(example, gradients), for each of `count` examples once, from several threads: adds to
  /// gradients that are 0 at first. Out: gradients, replaced by their sum. Errors: those of add().
  /// Threads and determinism: an example on each thread, those that are idle help; sums in the
  /// order of examples: same bits for any number of threads. Memory: gradients and what add() holds
  /// for each example that is worked on at the same time.
  void sum(size_t count, std::span<float> gradients,
           const std::function<void(size_t, std::span<float>)>& add);

 private:
  std::vector<std::vector<float>> own_;  // of those that are worked on
};

}  // namespace stipple
