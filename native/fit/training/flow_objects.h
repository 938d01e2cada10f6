#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/progress.h"
#include "fit/training/collection.h"
#include "generate/patch_condition.h"
#include "train/networks/density_autoencoder.h"
#include "train/networks/flow_trainer.h"

namespace stipple {

/// How objects become what a flow network learns.
struct FlowObjectOptions {
  size_t tokens = 128;
  PatchSizes patches;
  bool in_order = true;  ///< tokens go to scrambled Sobol points (token_order.h); false: as they
                         ///< were found, for comparison
};

/// The camera of a flow network (data/latent.h): of a view of an object around the origin.
std::array<float, 5> flowCamera(const Camera& camera);

/// Quarter turns about z that bring a camera within 45 degrees of +x, 0 to 3.
int quarterTurns(const Camera& camera);

/// Objects of a collection as latents, in the four quarter turns about z, and their images.
class FlowObjects final : public FlowSource {
 public:
  /// Encodes all objects. In: objects: numbers in the collection; values: the autoencoder's
  /// weights. Errors: those of reading images; kInvalidArgument where an object has no image that
  /// can be prepared; kCancelled.
  FlowObjects(std::shared_ptr<const Collection> collection, std::vector<size_t> objects,
              const DensityAutoencoder& networks, std::span<const float> values,
              const FlowObjectOptions& options, Progress* progress = nullptr);

  size_t count() const override { return objects_.size(); }
  /// The image is the draw's of those that can be prepared; object and camera are turned so that
  /// the camera is within 45 degrees of +x.
  FlowObject object(size_t index, uint64_t draw) const override;

 private:
  struct Encoded {
    std::array<std::vector<float>, 4> tokens;  ///< by quarter turns
    std::vector<size_t> views;                 ///< that can be prepared
  };

  std::shared_ptr<const Collection> collection_;
  std::vector<size_t> objects_;
  FlowObjectOptions options_;
  size_t tokens_ = 0, width_ = 0;
  std::vector<Encoded> encoded_;
};

}  // namespace stipple
