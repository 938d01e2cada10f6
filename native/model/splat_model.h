#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/memory_limit.h"
#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "decode/decoder.h"
#include "density/density_model.h"
#include "density/learned_draws.h"
#include "io/assets/asset_header.h"
#include "model/model_settings.h"

namespace stipple {

class BackendFactory;
class BudgetOctaves;
struct BudgetStep;

/// What an asset file holds beside the model, for saving it again.
struct ModelNotes {
  std::string settings_json = "{}";
  AssetExtras extras;
};

/// What reading an asset may need beside its file.
struct ReadingAid {
  /// Folders with files of networks' weights, which assets name and do not hold; empty: nobody has
  /// said where they are.
  std::vector<std::string> weights_folders;
  Progress* progress = nullptr;  ///< of reading; files of weights are hashed once
  /// What a model may look at its splats with later; null: it does without.
  std::shared_ptr<const BackendFactory> backends = nullptr;
};

/// What a model is, beside its settings. 0 where it does not apply.
struct ModelInfo {
  int leaf_level = 0;         ///< of its density
  uint64_t leaf_count = 0;    ///< of its density, or splats of its own
  uint64_t sample_count = 0;  ///< of the surface that it was made from
  int sh_degree = 0;          ///< of the splats that it makes
  std::array<float, 3> bounds_min = {0, 0, 0};
  std::array<float, 3> bounds_max = {0, 0, 0};
};

/// What is asked of a model.
struct ModelRequest {
  uint64_t budget = 20000;  ///< P, in the model's BudgetUnit
  AnchorOrder order = AnchorOrder::kSystematic;
  uint64_t seed = 0;
  uint32_t gaussians_per_anchor = 1;  ///< K; 1 stands for the model's own where it cannot make 1
  double time = 0.0;                  ///< seconds, finite; 0 where nothing moves
  /// For a budget that moves: splats move and grow and none of them jumps. Between two powers of two
  /// they are on the way from one to the other, up to twice as many as the budget, in the progressive
  /// order; at powers of two the splats of that order. Of a tree, Decoder::decodeSmooth(). For kinds
  /// that have it.
  bool smooth = false;
};

/// A source of splats at any budget. One sentence makes them: a density is sampled into anchors,
/// and a decoder turns all anchors at once into splats. A model without a density hands its budget
/// to the decoder instead.
///
/// A model never changes, so that several threads may decode it at once. To add a kind, derive from
/// this class and enter it in the table of model/model_kinds.cpp.
class SplatModel {
 public:
  SplatModel();
  virtual ~SplatModel();

  /// The name of its kind in the table.
  virtual const char* kind() const = 0;
  virtual ModelInfo info() const = 0;
  /// Null for a model that is not sampled.
  virtual std::shared_ptr<const DensityModel> density() const { return nullptr; }
  /// Writes an asset file that the kind's reader understands. Errors: kIo.
  virtual void save(const std::string& path) const = 0;

  /// The model of the splats whose mask is not 0. In: mask [N], N = info().leaf_count.
  /// Errors: kUnsupported for a model that has no splats of its own; kInvalidArgument for a mask of
  /// another length, or one that leaves nothing.
  virtual std::shared_ptr<const SplatModel> keep(std::span<const uint8_t> mask) const;
  /// Bytes that keep() holds at most.
  virtual uint64_t keepMemoryBound() const { return 0; }

  /// Which settings it has: those of its kind, with its own ranges.
  ModelSettings settings() const;
  /// The splats of a request. Errors: kInvalidArgument for a budget or a K outside settings(), a
  /// time that is not finite; kCancelled. Progress runs from begin to end of the whole work, and is
  /// left without parts.
  /// Threads and determinism: parallel; same result for any number of threads.
  SplatCloud decode(const ModelRequest& request, Progress* progress = nullptr, double begin = 0,
                    double end = 1) const;
  /// Bytes that decode() holds at most, without the model itself.
  uint64_t memoryBound(const ModelRequest& request) const;
  /// Refuses a request beyond the limit, with the budget that fits. Errors: kMemoryLimit.
  void requireMemory(const ModelRequest& request, const MemoryLimit& limit) const;

 protected:
  virtual const Decoder& decoder() const = 0;
  /// How anchors are drawn from the density.
  virtual LearnedDraws draws() const { return {}; }
  /// Enters the model's own ranges. In: settings of the kind, with defaults.
  virtual void limit(ModelSettings& settings) const = 0;

 private:
  class StepMaker;
  BudgetStep step(const ModelRequest& request, const ModelSettings& allowed, Progress* progress,
                  double begin, double end) const;
  uint64_t stepMemoryBound(const ModelRequest& request) const;
  /// What it remembers of smooth requests; the splats do not depend on it.
  const std::unique_ptr<BudgetOctaves> octaves_;
};

}  // namespace stipple
