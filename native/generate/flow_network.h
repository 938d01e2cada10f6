#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/latent.h"
#include "data/weight_table.h"
#include "generate/flow_block.h"
#include "generate/image_condition.h"
#include "generate/progress_share.h"
#include "nn/linear.h"
#include "nn/network_run.h"

namespace stipple {

constexpr size_t kCameraWidth = 5;
/// Published networks make 8192 tokens; those of earlier stages of training 1024 to 4096.
constexpr uint64_t kMostFlowTokens = 65536;

/// What the last norms add to variances.
constexpr float kFlowHeadEpsilon = 1e-5f;
/// How the network is told of a time of 0 to 1. Out: [width].
std::vector<float> flowTimeEncoding(double time, size_t width);

/// Sizes of a flow network, as its tensors have them. In brackets: the published network.
struct FlowSizes {
  FlowBlockSizes block;              ///< 1024 channels, 16 heads of 64, MLP 4096, rotary 128
  size_t block_count = 0;            ///< 24
  size_t noise_refiner_count = 0;    ///< 2
  size_t context_refiner_count = 0;  ///< 2
  size_t token_width = 0;            ///< 16
  size_t structure_width = 0;        ///< 1280
  size_t colour_width = 0;           ///< 128
  size_t time_width = 0;             ///< 256
};

/// An image as the blocks of a flow network see it: it does not depend on the time, so one serves
/// every step.
struct FlowContext {
  uint64_t rows = 0;
  /// How many equal rows each of these stands for: 1, or all where nothing is known of an image.
  /// Rows of zeros stay equal to each other in every layer, so that one of them does, if its key
  /// counts as many times in the attention.
  uint64_t copies = 1;
  std::vector<float> values;  ///< [rows, channels]
};

/// The network that says how a noisy latent flows towards one of an object in an image
/// ("LatentSeqMMFlowModel" of the code of arXiv 2605.16355): a transformer over the tokens of the
/// latent, of the image and of the camera. Weights stay in their file. Const members may be called
/// by several threads at a time.
class FlowNetwork {
 public:
  /// In: weights: names as published, without a prefix. Errors: kFormat, naming file, tensor, what
  /// was seen and what is allowed, for tensors that are missing, too many or of another shape.
  explicit FlowNetwork(const WeightTable& weights);

  const FlowSizes& sizes() const { return sizes_; }

  /// Errors: kInvalidArgument for a condition of other widths, or with NaN or infinity; kCancelled.
  FlowContext context(const NetworkRun& run, const ImageCondition& condition,
                      ProgressShare share = {}) const;
  /// The context of an image of which nothing is known, in place of `rows` rows.
  FlowContext emptyContext(const NetworkRun& run, uint64_t rows) const;

  /// The velocity of `state` at a time: how it changes from the object (time 0) to noise (time 1).
  /// In: state: token_count 1 to kMostFlowTokens, finite; time 0 to 1. Out: velocity of the same
  /// sizes.
  /// Errors: kInvalidArgument for other sizes, or NaN or infinity; kFormat where the result is not
  /// finite, which means wrong weights; kCancelled.
  /// Threads and determinism: parallel; same bits for any number of threads. Cost: flowCallCost()
  /// (generate/flow_cost.h). Memory: memoryBound().
  void velocity(const NetworkRun& run, const Latent& state, double time, const FlowContext& context,
                Latent& velocity, ProgressShare share = {}) const;

  /// The most bytes that velocity() and context() take beside their arguments, what layers pack
  /// included. Weights are not: they are pages of a file. Each of six large arrays may take up to
  /// 2 MiB more, by pages.
  uint64_t memoryBound(uint64_t token_count, uint64_t context_rows) const;

 private:
  struct Time;
  void readSizes(const WeightTable& weights);
  void readBlocks(const WeightTable& weights);
  Time embedTime(const NetworkRun& run, double time) const;
  void embed(const NetworkRun& run, const Latent& state, float* h) const;
  void requireState(const Latent& state, double time, const FlowContext& context) const;
  void readOut(const NetworkRun& run, const Time& time, size_t rows, float* h,
               Latent& velocity) const;

  FlowSizes sizes_;
  std::string source_;
  Linear input_, structure_, colour_, camera_in_, camera_out_;  // camera_out_: to channels
  Linear time_in_, time_out_, modulation_, token_head_, camera_head_;
  std::vector<float> shift_table_;  ///< [2, channels]: shift, scale of what is read out
  std::vector<FlowBlock> noise_refiners_, context_refiners_, blocks_;
};

}  // namespace stipple
