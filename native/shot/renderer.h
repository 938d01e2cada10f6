#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <span>

#include "base/progress.h"
#include "shot/cloud_cuts.h"
#include "shot/instances.h"
#include "shot/passes.h"
#include "shot/shot_settings.h"
#include "splat/render/image_renderer.h"
#include "splat/render/render_backward.h"

namespace stipple {

/// Makes the passes of shots, with memory that it keeps from one picture to the next. Every member
/// may be called by any thread; a picture that is made while another one is takes memory of its
/// own.
class Renderer {
 public:
  /// In: images: makes what draws.
  explicit Renderer(std::shared_ptr<const ImageRendererFactory> images);

  /// Draws the instances, cut, sampled and finished as the settings say, into the passes.
  /// In: settings, which validate() accepts, with the passes asked for. Errors: the renderers'.
  void render(Instances instances, const Camera& camera, const ShotSettings& settings,
              const ShotPasses& passes, Progress& progress);

  /// Upper bounds of the bytes that render() allocates.
  RenderMemory memory(const Instances& instances, const Camera& camera,
                      const ShotSettings& settings) const;

  /// How many pictures render() averages: 1 where all is sharp.
  static uint32_t sampleCount(const Instances& instances, const Camera& camera,
                              const ShotSettings& settings);

  /// Derivatives of one sharp picture. In: deliver, called once with all of them unless the work is
  /// cancelled.
  void backward(const Instances& instances, const Camera& camera, const RenderOptions& options,
                const BackwardInput& input,
                const std::function<void(const BackwardResult&)>& deliver, Progress& progress);

  /// The order in which a graphics card draws the splats.
  void order(const Instances& instances, const Camera& camera, const DrawOrderOutput& output,
             Progress& progress);

 private:
  void renderSharp(const Instances& instances, const Camera& camera, const ShotSettings& settings,
                   const ShotPasses& passes, Progress& progress);
  void renderBlurred(const Instances& instances, const Camera& camera, const ShotSettings& settings,
                     const ShotPasses& passes, Progress& progress);

  std::shared_ptr<const ImageRendererFactory> factory_;
  CloudCuts cuts_;  ///< has a lock of its own

  std::mutex mutex_;  ///< held while a picture or its derivative uses what follows
  std::unique_ptr<ImageRenderer> images_;
  RenderResult result_;
  BackwardWorkspace backward_workspace_;
  BackwardResult backward_result_;

  std::mutex order_mutex_;  ///< of orders_: an order and a picture may be made at once
  std::unique_ptr<ImageRenderer> orders_;
};

}  // namespace stipple
