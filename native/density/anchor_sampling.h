#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/progress.h"
#include "density/density_model.h"
#include "density/octree_density.h"
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
  bool with_ranks = false;  ///< progressive only: also give the budget from which each anchor exists
};

/// Anchors in Morton order of their leaves.
struct AnchorSet {
  std::vector<float> positions;  ///< [P,3] in the unit cube of the root
  std::vector<float> log_q;      ///< [P] log probability of the anchor's leaf
  std::vector<uint64_t> leaves;  ///< [P] Morton code of the leaf at the model's leaf level
  std::vector<uint64_t> ranks;   ///< [P] smallest budget that holds the anchor, where asked for
  int leaf_level = 0;

  size_t size() const { return log_q.size(); }
};

/// Ancestral sampling. Same result for any number of threads.
AnchorSet sampleAnchors(const DensityModel& model, const AnchorSamplingOptions& options,
                        Progress* progress = nullptr);

/// The same with the random numbers of `source`, drawn in the order of the specification
/// (per level one draw per parent in frontier order, then three per point): for recorded streams.
AnchorSet sampleAnchors(const DensityModel& model, const AnchorSamplingOptions& options,
                        UniformSource& source);

}  // namespace stipple
