#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "data/latent.h"
#include "data/tensor_table.h"
#include "generate/flow_network.h"
#include "generate/progress_share.h"
#include "generate/seeded_noise.h"
#include "nn/network_run.h"

namespace stipple {

/// How noise is led to a latent.
struct FlowSettings {
  /// 1 to 1000. Time and detail rise with it; 10 to 20 are recommended for the published network.
  uint32_t steps = 20;
  /// How much more than plainly the image is followed, 0 to 100. Above 1 every step also runs the
  /// network without an image; up to 1 it does not, which is twice as fast or more.
  double guidance = 3.0;
  /// 0.01 to 100. Above 1 more of the steps are spent where there is much noise.
  double shift = 3.0;
};

/// Errors: kInvalidArgument for a value outside its range.
void validate(const FlowSettings& settings);

/// The times of all steps and the end: steps + 1 numbers that fall from 1 to 0,
/// shift u / (1 + (shift - 1) u) for u = 1 - i / steps.
std::vector<double> flowTimes(const FlowSettings& settings);

/// Sampling as it stands between two calls of the network. Numbers and settings are all that it
/// needs, so it can be kept, and continued later to the same bits.
struct SamplerState {
  FlowSettings settings;
  uint32_t step = 0;  ///< steps that are done
  Latent latent;      ///< at flowTimes(settings)[step]; of the object itself once step == steps
  /// The velocity towards the image in step `step`, where that call is done and the one without an
  /// image is not; else without tokens.
  Latent towards_image;

  bool finished() const { return step >= settings.steps; }
};

/// In: token_count 1 to kMostFlowTokens; noise: `tokens` and `camera` as drawNoise() gives them.
/// Errors: kInvalidArgument for settings that validate() refuses and noise of other sizes.
SamplerState startSampling(const FlowNetwork& network, uint64_t token_count,
                           const GenerationNoise& noise, const FlowSettings& settings);

/// What the object looks like from a step: the latent that the velocity of this step points to,
/// x - t v. It is blurred at first, and the last step's is the result.
struct FlowPreview {
  uint32_t step = 0;  ///< steps that are done, 1 to steps - 1
  uint32_t steps = 0;
  Latent latent;
};

struct FlowListener {
  /// Called on the thread that samples, between two steps. What it throws leaves sampleLatent().
  std::function<void(const FlowPreview&)> preview;
  uint32_t preview_every = 4;  ///< steps between two previews; 0: none
};

/// Goes on from `state` to the end: Euler steps x -= v (t_i - t_i+1) with
/// v = guidance v_image - (guidance - 1) v_nothing, for tokens and camera alike.
/// In: context: FlowNetwork::context() of the image. In and out: state. Where this throws, state is
/// that after the last call of the network that was finished.
/// Progress is told by the work of the calls, so that it rises evenly with time.
/// Errors: kCancelled; kInvalidArgument for a state that is not one of this network.
/// Threads and determinism: same bits for any number of threads, and whether interrupted or not.
/// Cost: flowSamplingCost() (generate/flow_cost.h).
void sampleLatent(const NetworkRun& run, const FlowNetwork& network, const FlowContext& context,
                  SamplerState& state, const FlowListener& listener = {}, ProgressShare share = {});

/// The state as tensors, "flow." before their names.
TensorTable tensorsOfSampler(const SamplerState& state);
/// Errors: kFormat, naming the tensor that is missing or has what no state has.
SamplerState samplerOfTensors(const TensorTable& table);

}  // namespace stipple
