#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "densify/splat_edit.h"
#include "densify/statistic.h"
#include "densify/strategy.h"
#include "math/camera.h"
#include "splat/render/render.h"
#include "train/backend/view_pass.h"
#include "train/optimiser/adam.h"
#include "train/optimiser/image_loss.h"

namespace stipple {

/// Numbers of a Gaussian that share a learning rate.
enum class ParameterGroup : uint32_t {
  kPositions = 0,
  kRotations = 1,
  kLogScales = 2,
  kLogits = 3,
  kShFirst = 4,   ///< the constant harmonic
  kShOthers = 5,  ///< the ones above it
};
constexpr size_t kParameterGroupCount = 6;

struct StepOptions {
  /// By ParameterGroup. A group of rate 0 takes no step: its moments stay as they are.
  std::array<double, kParameterGroupCount> learning_rates{};
  std::vector<double> extra_rates;  ///< of RawSplats::extras; absent ones are 0
  AdamOptions adam;
};

/// A part of the loss that depends on no target.
class Regulariser {
 public:
  virtual ~Regulariser() = default;
  /// False: evaluate() has nothing to add, and is not called: splats are copied out for it.
  virtual bool readsSplats() const { return true; }
  /// Returns: the value of what depends on the splats alone. Its derivative is added to `gradient`.
  virtual double evaluate(const SplatCloud& cloud, const CloudGradient& gradient) = 0;
  /// Beside that: weight of the mean transmittance behind the last splat of each pixel. Where it is
  /// not 0, the picture must have been drawn with transmittance.
  virtual double transmittanceWeight() const { return 0; }
};

/// Everything of a fit that a checkpoint has to keep.
struct TrainingState {
  RawSplats splats;
  RawSplats first_moments;
  RawSplats second_moments;
  RawSplats kept_gradients;  ///< of keepGradients() since the last step; no splats: none
  uint64_t step = 0;         ///< taken so far
};

/// Holds the splats of a fit and does its passes, each by one call: forward, loss, backward, step,
/// and now and then an edit. Parameters, moments, pictures, derivatives and statistics stay inside,
/// so that they may lie in the memory of another processor; what the caller wants to see (that of
/// SplatReader, state() and what follows backward()) is copied out on demand, and valid until the
/// next call that changes anything. One call at a time.
///
/// Errors of every call: kInvalidArgument for arguments outside their range and for a pass out of
/// its order; what the backend holds is then as it was.
/// Determinism: the same calls give the same bits, for any number of threads.
class RenderBackend : public SplatReader {
 public:
  /// Takes the splats of a fit, forgets what was held. Moments and step become 0, or those of a
  /// checkpoint; pictures stay.
  virtual void upload(const SplatCloud& cloud) = 0;
  virtual void restore(const TrainingState& state) = 0;

  /// How raw numbers become splats, from now on; null: as raw_splats.h says. It works on arrays of
  /// the host: with it raw numbers are copied out, and derivatives back, in every step. It must
  /// live as long as the backend. Extras without it get no derivative.
  virtual void parameterise(const Parameterisation* how) = 0;

  virtual size_t splatCount() const = 0;
  virtual SplatCloud download() const = 0;
  virtual const TrainingState& state() const = 0;
  virtual uint64_t memoryBytes() const = 0;  ///< held now, about

  /// Keeps a target picture [H,W,3], in the space in which splats are composited. Returns its
  /// number: 0, 1, 2...
  virtual uint32_t addTarget(uint32_t width, uint32_t height, std::span<const float> pixels) = 0;

  /// Multiplies the opacities of the next image, and so its derivatives by them: [N] >= 0, or
  /// empty. More than opaque counts as opaque. Edits and steps before that image end it.
  virtual void weighOpacities(std::vector<float> factors) = 0;

  /// Draws the splats.
  virtual void forward(const Camera& camera, const RenderOptions& options,
                       Progress* progress = nullptr) = 0;

  /// Loss of the drawn picture against a target, and its derivative by the picture. In: weights
  /// [H,W] >= 0, or empty: 1.
  virtual ImageLossValue loss(uint32_t target, const ImageLossOptions& options,
                              std::span<const float> weights = {}) = 0;
  /// The same against a picture [H,W,3] that is not kept: it and the weights are the caller's until
  /// the last call about this view.
  virtual ImageLossValue loss(std::span<const float> target, const ImageLossOptions& options,
                              std::span<const float> weights = {}) = 0;

  /// Derivatives of that loss by the raw parameters, and statistics. In: regulariser: what adds to
  /// the loss, or null; structure errors need a loss with them.
  virtual BackwardSummary backward(const StatisticRequest& request,
                                   Regulariser* regulariser = nullptr,
                                   Progress* progress = nullptr) = 0;

  /// One step of Adam along them and those that were kept. May follow a backward pass once.
  virtual void step(const StepOptions& options) = 0;

  /// Instead of a step: the derivatives add up until the next one, and move with edits.
  virtual void keepGradients() = 0;

  /// Changes which splats there are. Drawn picture, derivatives and statistics are gone after it.
  virtual void edit(const SplatEdit& edit) = 0;

  /// [H,W,4] drawn last.
  virtual std::vector<float> picture() const = 0;
  /// By the raw parameters, of the last backward pass.
  virtual RawSplats gradients() const = 0;
  /// [N] or as stated, of the last backward pass; refused where it was not asked for.
  virtual std::vector<float> statistic(Statistic statistic) const = 0;
  /// All that a strategy is told of the last backward pass. Out: everything but the number of the
  /// view, valid until the next call.
  virtual void lendStatistics(ViewStatistics& statistics) = 0;
};

/// Keeps splats, moments and targets on the host and takes its steps there; what it draws and
/// differentiates is done by `pass`. A kind of processor that has a pass can fit splats with it.
std::unique_ptr<RenderBackend> makeHostBackend(std::unique_ptr<ViewPass> pass);

/// The same with the pass of this processor.
std::unique_ptr<RenderBackend> makeCpuBackend();

}  // namespace stipple
