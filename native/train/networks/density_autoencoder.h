#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "data/tensor_table.h"
#include "math/camera.h"
#include "train/backend/backend_factory.h"
#include "train/networks/autoencoder_losses.h"
#include "train/networks/trained_encoder.h"
#include "train/networks/trained_gaussians.h"
#include "train/networks/trained_octree.h"

namespace stipple {

/// Sizes of the three networks, which are as wide as each other.
struct AutoencoderSizes {
  size_t heads = 4;
  size_t head_width = 32;
  size_t latent_width = 16;
  size_t mlp_ratio = 4;
  size_t encoder_blocks = 4, octree_blocks = 2, splat_blocks = 4;
  std::vector<size_t> feature_widths = {3};  ///< of one or two kinds
  uint32_t gaussians = 8;                    ///< of each anchor, 4 to 32
  int leaf_level = 8;                        ///< 1 to kMaxLeafLevel
  /// Lengths of splats are multiples of how far apart anchors stand, as in fields; false: in one
  /// unit, whatever the budget is, as published.
  bool follows_spacing = false;
};

/// Errors: kInvalidArgument with the number, its value and what is allowed.
void validate(const AutoencoderSizes& sizes);

/// A view of an object, whose unit cube has its middle in the origin.
struct ObjectView {
  Camera camera;
  std::vector<float> image;  ///< [H,W,3], before `background`
  std::vector<float> alpha;  ///< [H,W], of the object
};

/// Views of an object, read when they are looked at: a step looks at a few of many. Several threads
/// ask at the same time.
class ObjectViews {
 public:
  virtual ~ObjectViews() = default;
  virtual size_t count() const = 0;
  /// Errors: those of reading an image.
  virtual ObjectView view(size_t index) const = 0;
};

/// Views that are in memory.
class KeptViews final : public ObjectViews {
 public:
  explicit KeptViews(std::vector<ObjectView> views) : views_(std::move(views)) {}
  size_t count() const override { return views_.size(); }
  ObjectView view(size_t index) const override { return views_[index]; }

 private:
  std::vector<ObjectView> views_;
};

/// An object of a collection.
struct TrainingObject {
  std::vector<std::vector<float>> points;    ///< of each kind [count,3], in the unit cube 0..1
  std::vector<std::vector<float>> features;  ///< of each kind [count, width]
  std::vector<float> surface;                ///< [count,3], in the unit cube
  std::shared_ptr<const ObjectViews> views;  ///< images of the object before black; null: none
};

/// What is learned.
enum class AutoencoderStage {
  kStructure,   ///< encoder and density, from the surface
  kAttributes,  ///< splats, too, from images; the density from the surface alone
  kJoint,       ///< the density also from what its anchors do to images
};

struct AutoencoderLossWeights {
  double structure = 1;
  double divergence = 0.01;
  double ssim = 0.2;  ///< of 1 - SSIM, beside L1 with a weight of 1
  double density = 1;
  SplatLossWeights splats;
};

/// One example of one step.
struct AutoencoderExample {
  const TrainingObject* object = nullptr;
  AutoencoderStage stage = AutoencoderStage::kStructure;
  size_t tokens = 256;     ///< of the latent, at most as many as points of the first kind
  uint64_t anchors = 256;  ///< that are drawn
  size_t views = 4;        ///< that are looked at, at most as many as there are
  size_t surface =
      8192;           ///< points of the surface that tell the density, drawn where there are more
  uint64_t seed = 0;  ///< of noise, anchors, views and backgrounds
  bool keeps_encoder = false;  ///< nothing is learned by it: latents stay as they are
  double share = 1;            ///< of the step: one over its examples, times the scale of its loss
};

/// What an example lost, without weights.
struct AutoencoderLosses {
  double total = 0;  ///< with weights
  double structure = 0, divergence = 0;
  double l1 = 0, ssim = 1;
  SplatLosses splats;
};

/// Which splats of a latent are drawn.
struct AnchorDraw {
  uint64_t anchors = 256;
  uint64_t seed = 0;
};

/// The density autoencoder as it is trained: encoder, density and splats.
class DensityAutoencoder {
 public:
  /// In: precision, of the factors of products in blocks. Errors: kInvalidArgument (validate());
  /// kUnavailable (requirePrecision()).
  explicit DensityAutoencoder(const AutoencoderSizes& sizes,
                              FactorPrecision precision = FactorPrecision::kFloat32);

  const ParameterLayout& layout() const { return layout_; }
  const AutoencoderSizes& sizes() const { return sizes_; }
  /// Weights to begin with: Xavier-uniform, keyed by the seed; what the networks say is 0, so that
  /// the density begins even and splats fill their lattice.
  std::vector<float> startValues(uint64_t seed) const;

  /// All tensors by their published names, with what networks that are only run read besides
  /// (decode/latent).
  TensorTable tensors(std::span<const float> values) const;

  /// Loss of an example, and its derivatives. Out: gradients of the layout, which this adds to.
  /// Errors: kInvalidArgument for an object that is empty or has other features; kCancelled.
  /// Threads and determinism: parallel; same bits for any number of threads.
  AutoencoderLosses addExample(std::span<const float> values, const AutoencoderExample& example,
                               const AutoencoderLossWeights& weights,
                               const BackendFactory& backends, std::span<float> gradients,
                               Progress* progress = nullptr) const;

  /// What a latent's splats lose in one view, L1 and `ssim` times 1 - SSIM before white or black,
  /// with derivatives by their colours alone: all else of them is taken as it is. Out: by_latent
  /// [tokens, latent_width], which this adds to. Errors and determinism: as addExample().
  ImageLossValue addColours(std::span<const float> values, std::span<const float> latent,
                            const ObjectView& view, const AnchorDraw& draw, double ssim,
                            const BackendFactory& backends, std::span<float> by_latent) const;

  /// The latent of an object, the mean of what is drawn. Out: [tokens, latent_width].
  std::vector<float> encode(std::span<const float> values, const TrainingObject& object,
                            size_t tokens) const;
  /// Splats of a latent, in the cube around the origin. In: latent [tokens, latent_width].
  SplatCloud decode(std::span<const float> values, std::span<const float> latent, uint64_t anchors,
                    uint64_t seed) const;

 private:
  struct Splats;

  std::vector<FeaturePoints> pointsOf(const TrainingObject& object) const;
  Splats splatsOf(std::span<const float> values, const ContextRows& latent, uint64_t anchors,
                  uint64_t seed) const;
  /// From derivatives by splats, in the cube around the origin, to those by weights and latent.
  void backwardOfSplats(std::span<const float> values, const ContextRows& latent, Splats& splats,
                        const SplatCloud& by_cloud, std::span<float> gradients,
                        float* by_latent) const;
  /// Derivatives by the latent; losses of images go to `losses`.
  void addImages(std::span<const float> values, const AutoencoderExample& example,
                 const AutoencoderLossWeights& weights, const BackendFactory& backends,
                 const ContextRows& latent, std::span<float> gradients, float* by_latent,
                 AutoencoderLosses& losses, Progress* progress) const;
  void addDensity(std::span<const float> values, const ContextRows& latent,
                  std::span<const OctreeLevel> levels, double factor, std::span<float> gradients,
                  float* by_latent, double& loss) const;

  AutoencoderSizes sizes_;
  ParameterLayout layout_;
  TrainedEncoder encoder_;
  TrainedOctree octree_;
  TrainedGaussians splats_;
};

}  // namespace stipple
