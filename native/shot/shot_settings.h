#pragma once

#include <cstdint>

#include "shot/accuracy_settings.h"
#include "shot/instances.h"
#include "shot/sampled_render.h"
#include "shot/surroundings.h"

namespace stipple {

/// Which renderer draws.
enum class ShotMethod : uint32_t {
  kTiled = 0,      ///< the cheapest that keeps the accuracy asked for
  kReference = 1,  ///< the same settings in double, every splat at every pixel
  kRays = 2,       ///< exact order and shape of the splats
  kRaysUnlimited = 3,  ///< the same without limits
};

enum class OutputColour : uint32_t {
  kSceneLinear = 0,  ///< light, whatever space the splats are composited in
  kComposited = 1,   ///< the composited values as they are
};

/// What a picture of placed splats is to be, beside its camera.
struct ShotSettings {
  RenderOptions options;
  ShotMethod method = ShotMethod::kTiled;
  RenderAccuracy accuracy;  ///< of kTiled
  double budget_share = 1;  ///< of the splats of each cloud
  bool has_accuracy = false;
  Sampling sampling;
  const float* splat_light = nullptr;  ///< [H,W,3] factors of the splats' light; null: 1
  /// [H,W,3] in the space that colours come out in: what is behind everything; null: nothing.
  const float* background_image = nullptr;
  Surroundings surroundings;  ///< what is behind everything, in all directions
  /// True: expected depth only where half of a pixel is covered or more, and of splats alone where
  /// they show no less than the surface.
  bool solid_depth = false;
  bool linearise = false;  ///< the composited values are display values and light is asked for
  /// Composited values are display values and stay so, but light is what pictures are averaged in.
  bool averages_light = false;
};

/// Takes the knobs of an accuracy, after everything of `options`. Errors: kInvalidArgument where
/// the method or the low-pass says otherwise.
void takeAccuracy(const AccuracySettings& accuracy, ShotSettings& settings);

/// Decides where values are converted, from the spaces of the clouds and what is asked for; the
/// background becomes one of the compositing space. Last of all settings.
void takeOutput(OutputColour output, const Instances& instances, ShotSettings& settings);

/// Whether splats are followed along the rays of the pixels by the method itself.
bool followsRays(ShotMethod method);

/// Refuses a camera that the method cannot draw, and a surface or light that is not one of the
/// camera's picture. Errors: kInvalidArgument.
void validate(const ShotSettings& settings, const Camera& camera);

/// Refuses what is drawn but has no derivative. Errors: kInvalidArgument, kUnsupported.
void requireDerivative(const ShotSettings& settings, const Instances& instances);

/// Refuses what measuring chooses itself or does not draw. Errors: kInvalidArgument.
void requireMeasurable(const ShotSettings& settings);

}  // namespace stipple
