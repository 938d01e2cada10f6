#pragma once

#include <cstddef>
#include <cstdint>

#include "base/default_init_vector.h"
#include "base/progress.h"
#include "density/density_model.h"
#include "density/uniform_source.h"

namespace stipple {

constexpr uint64_t kMaxAnchorCount = uint64_t{1} << 28;

enum class AnchorOrder : uint32_t {
  kSystematic = 0,   ///< every child count is floor or ceil of its expectation
  kProgressive = 1,  ///< nested: a smaller budget is a subset of a larger one with the same seed
};

struct AnchorSamplingOptions {
  uint64_t count = 1000;  ///< P, 1..2^28; exactly this many come back
  AnchorOrder order = AnchorOrder::kSystematic;
  uint64_t seed = 0;
  bool with_ranks = false;  ///< progressive only: also the budget from which each anchor exists
};

/// Anchors in Morton order of their leaves.
struct AnchorSet {
  DefaultInitVector<float> positions;  ///< [P,3] in [0,1)^3 of the root cube, multiples of 2^-24
  DefaultInitVector<float> log_q;      ///< [P] log probability of the anchor's leaf
  DefaultInitVector<uint64_t> leaves;  ///< [P] Morton code of the leaf at the model's leaf level
  DefaultInitVector<uint64_t> ranks;   ///< [P] smallest budget that holds it, where asked for
  int leaf_level = 0;

  size_t size() const { return log_q.size(); }
};

/// Positions [P,3] of anchors in metres. In: root, the cube that they were drawn from.
void anchorPositions(const AnchorSet& anchors, const RootCube& root, float* out);

/// Bytes of that many anchors without ranks, at most.
uint64_t anchorSetBytes(uint64_t count);

/// Bytes that sampleAnchors holds at most, the result included, without those of the model.
uint64_t sampleMemoryBound(uint64_t count, bool with_ranks);

/// Ancestral sampling: exactly options.count anchors. A model that has tables is read through them,
/// any other is asked level by level on the sampled frontier, with the same result.
/// Errors: kInvalidArgument for a count outside 1..2^28, ranks in the systematic order, an
/// OctreeDensity that was never built, a model whose numbers are not log-probabilities; kCancelled.
/// Threads and determinism: parallel; same result for any number of threads.
/// Cost: O(P + visited cells). Source: docs/methods/density_sampling.md.
AnchorSet sampleAnchors(const DensityModel& model, const AnchorSamplingOptions& options,
                        Progress* progress = nullptr);

/// The same with the random numbers of `source`, drawn in the order of the specification
/// (systematic: per level one draw per parent in frontier order, then three per point; progressive:
/// per level and parent one draw per binary split with mass on both sides), on one thread: for
/// recorded streams. A KeyedUniformSource gives the same leaves as its seed, but other positions.
AnchorSet sampleAnchors(const DensityModel& model, const AnchorSamplingOptions& options,
                        UniformSource& source);

}  // namespace stipple
