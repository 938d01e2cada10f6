#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace stipple {

/// How the float32 numbers of a picture lie in memory. Row 0 is the top.
enum class PixelLayout : uint32_t {
  kRgb = 0,     ///< [H,W,3]
  kRgba = 1,    ///< [H,W,4]; alpha takes no part in the loss and its gradient is 0
  kPlanar = 2,  ///< [3,H,W]
};

struct PictureView {
  const float* values = nullptr;
  PixelLayout layout = PixelLayout::kRgb;
};

struct GradientView {
  float* values = nullptr;
  PixelLayout layout = PixelLayout::kRgb;
};

struct ImageLossOptions {
  /// lambda, 0..1: the share of 1 - SSIM beside L1. Raising it favours structure over levels.
  double ssim_share = 0.2;
  bool with_structure_errors = false;  ///< keeps what structureErrors() gives
};

struct ImageLossValue {
  double loss = 0;  ///< (1 - lambda) l1 + lambda (1 - ssim)
  double l1 = 0;    ///< weighted mean of |rendered - target| over pixels and channels
  double ssim = 1;  ///< weighted mean over pixels and channels
};

/// Largest magnitude of a colour that the loss takes: its products stay far inside float32.
constexpr float kLargestColour = 1e6f;

struct LossKernel;

/// The loss of trained splats, L1 and SSIM, with its exact gradient; keeps its working memory
/// between calls, so an object serves one call at a time.
///
/// SSIM: 11x11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, range 1. At the borders the
/// window reads zeros outside the picture and is not renormalised, as the published trainers do
/// (data/images/image_comparison.h, which reports quality, renormalises: the two differ near borders).
class ImageLoss {
 public:
  ImageLoss();
  /// With a kernel of lossKernels(): for tests and benchmarks.
  explicit ImageLoss(const LossKernel& kernel);
  ~ImageLoss();

  /// In: rendered, target: pictures of height x width, colours of about 0..1, as they are
  /// composited. weights [H,W] >= 0 or null for 1 everywhere: the loss is the weighted mean over
  /// the pixels, 0 where all weights are 0; windows of SSIM still read pixels of weight 0.
  /// Out: gradient [as its layout says]: d loss / d rendered, at |x - y| = 0 that of L1 is 0; null
  /// values: the value alone, for less than half the time. It may not overlap the pictures.
  /// Errors: kInvalidArgument for lambda outside 0..1, a null picture, a colour that is not finite
  /// or beyond +-1e6, a weight that is negative or not finite; the gradient then has no meaning.
  /// Threads and determinism: tiles in parallel; the same bits for any number of threads.
  /// Cost: O(pixels), seven separable blurs per channel; about 0.5 MB per thread. No allocation
  /// after the first call of a size and thread limit. Numbers: float32, sums float64.
  ImageLossValue evaluate(uint32_t width, uint32_t height, PictureView rendered, PictureView target,
                          const float* weights, GradientView gradient,
                          const ImageLossOptions& options = {});

  /// [H,W] of the last call, where it was asked for: 1 - SSIM of each pixel, 0..2, the mean of its
  /// channels, times its weight. Valid until the next call.
  std::span<const float> structureErrors() const;

  /// Bytes of working memory held now.
  size_t workspaceBytes() const;

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

}  // namespace stipple
