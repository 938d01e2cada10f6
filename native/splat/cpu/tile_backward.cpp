#include "splat/cpu/tile_backward.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "splat/scene_backward.h"

// As in cpu/tiled_render.cpp, pixels in which float32 rounding could decide a threshold are found
// by the kernel and done in double, so every decision is the renderer's.

namespace stipple {

namespace {

constexpr size_t kBatchSize = 128;
/// Batches whose splats stay ready between the two passes; those before them are made again.
constexpr size_t kBatchesKept = 32;
/// At least ln(1e-4)/ln(1 - 1/255): more splats cannot blend before a pixel ends.
constexpr size_t kMostBlended = 2352;
constexpr double kGScale = 0.84932180028801904;  // sqrt(log2(e)/2): g = this times L d

double valueAt(std::span<const float> values, size_t index, double otherwise) {
  return values.empty() ? otherwise : static_cast<double>(values[index]);
}

PixelLoss<double> lossAt(const PictureLoss& picture, size_t pixel) {
  const BackwardInput& input = *picture.input;
  PixelLoss<double> loss{};
  for (size_t c = 0; c < 4; ++c) {
    loss.gradient[c] = static_cast<double>(input.colour_gradient[pixel * 4 + c]);
  }
  if (picture.with_background) loss.gradient[3] = 0.0;
  if (picture.mode == BackwardMode::kGradients) return loss;
  const double weight = valueAt(input.residual_weights, pixel, 1.0);
  for (size_t c = 0; c < 3; ++c) {
    const double residual = valueAt(input.residual, pixel * 3 + c, 0.0);
    loss.signed_weight[c] = residual < 0.0 ? -weight : weight;
    loss.room[c] = 2.0 * weight * std::abs(residual);
  }
  loss.edge = valueAt(input.edge_weights, pixel, 0.0);
  loss.error = valueAt(input.errors, pixel, 0.0);
  return loss;
}

/// State of a pixel before its last splat is taken off.
PixelBackward<double> startBehind(const PictureLoss& picture, const PixelLoss<double>& loss,
                                  double transmittance) {
  PixelBackward<double> pixel;
  pixel.transmittance = transmittance;
  pixel.behind = 0.0;
  for (int c = 0; c < 3; ++c) {
    pixel.colour_behind[c] = picture.with_background ? picture.background[c] : 0.0;
    pixel.behind += pixel.colour_behind[c] * loss.gradient[c];
  }
  return pixel;
}

}  // namespace

TileBackward::TileBackward()
    : pixels_(std::make_unique<BackwardPixels>()), splats_(kBatchSize * kBatchesKept) {
  blended_.reserve(kMostBlended);
}

void TileBackward::begin(const BackwardKernel& kernel, const VisibleSplat* visible,
                         const PictureLoss& loss) {
  kernel_ = &kernel;
  visible_ = visible;
  loss_ = &loss;
}

uint64_t TileBackward::memoryBound() {
  return sizeof(BackwardPixels) + kBatchSize * kBatchesKept * sizeof(BackwardSplat) +
         kMostBlended * sizeof(Blended);
}

void TileBackward::clearPixels(const Tile& tile) {
  BackwardPixels& pixels = *pixels_;
  std::fill(std::begin(pixels.transmittance), std::end(pixels.transmittance), 1.0f);
  std::fill(std::begin(pixels.doubt), std::end(pixels.doubt), 0.0f);
  std::fill(std::begin(pixels.last), std::end(pixels.last), -1);
  std::fill(std::begin(pixels.cut), std::end(pixels.cut), kFinished);
  for (uint32_t y = 0; y < tile.height; ++y) {
    std::fill_n(pixels.cut + static_cast<size_t>(y) * kTileSide, tile.width, kLog2MinAlpha);
  }
  pixels.unfinished = tile.width * tile.height;
}

void TileBackward::makeBatch(const Tile& tile, size_t batch) {
  BackwardSplat* out = &splats_[batch % kBatchesKept * kBatchSize];
  const size_t begin = batch * kBatchSize;
  const size_t end = std::min(begin + kBatchSize, tile.splats.size());
  for (size_t i = begin; i < end; ++i) {
    *out++ = {makeTileSplat(visible_[tile.splats[i]], tile), 0};
  }
}

/// Returns how many splats from the front were looked at before every pixel had ended.
size_t TileBackward::mark(const Tile& tile) {
  size_t begin = 0;
  for (; begin < tile.splats.size() && pixels_->unfinished > 0; begin += kBatchSize) {
    const size_t batch = begin / kBatchSize;
    makeBatch(tile, batch);
    kernel_->mark(&splats_[batch % kBatchesKept * kBatchSize],
                  std::min(kBatchSize, tile.splats.size() - begin), static_cast<int32_t>(begin),
                  *pixels_);
  }
  return std::min(begin, tile.splats.size());
}

void TileBackward::prepareTakeOff(const Tile& tile, double* background) {
  BackwardPixels& pixels = *pixels_;
  for (uint32_t y = 0; y < tile.height; ++y) {
    for (uint32_t x = 0; x < tile.width; ++x) {
      const size_t i = static_cast<size_t>(y) * kTileSide + x;
      if (pixels.doubt[i] != 0.0f) {
        pixels.last[i] = -1;
        continue;
      }
      const PixelLoss<double> loss =
          lossAt(*loss_, static_cast<size_t>(tile.y0 + y) * loss_->width + tile.x0 + x);
      const double transmittance = static_cast<double>(pixels.transmittance[i]);
      const PixelBackward<double> pixel = startBehind(*loss_, loss, transmittance);
      for (size_t c = 0; c < 4; ++c) pixels.gradient[c][i] = static_cast<float>(loss.gradient[c]);
      pixels.behind[i] = static_cast<float>(pixel.behind);
      for (size_t c = 0; c < 3; ++c) background[c] += transmittance * loss.gradient[c];
      if (loss_->mode == BackwardMode::kGradients) continue;
      for (size_t c = 0; c < 3; ++c) {
        pixels.colour_behind[c][i] = static_cast<float>(pixel.colour_behind[c]);
        pixels.signed_weight[c][i] = static_cast<float>(loss.signed_weight[c]);
        pixels.room[c][i] = static_cast<float>(loss.room[c]);
      }
      pixels.edge[i] = static_cast<float>(loss.edge);
      pixels.error[i] = static_cast<float>(loss.error);
    }
  }
}

void TileBackward::takeOff(const Tile& tile, size_t used, float* sums) {
  const size_t field_count = backwardFieldCount(loss_->mode);
  const size_t batches = (used + kBatchSize - 1) / kBatchSize;
  for (size_t batch = batches; batch-- > 0;) {
    BackwardSplat* splats = &splats_[batch % kBatchesKept * kBatchSize];
    const size_t begin = batch * kBatchSize;
    const size_t count = std::min(kBatchSize, used - begin);
    if (batch + kBatchesKept < batches) {
      makeBatch(tile, batch);
      for (size_t i = 0; i < count; ++i) {
        splats[i].rows = (1u << splats[i].row_end) - (1u << splats[i].row_begin);
        if (splats[i].row_end <= splats[i].row_begin) splats[i].rows = 0;
      }
    }
    kernel_->take_off(splats, count, static_cast<int32_t>(begin), loss_->mode, *pixels_,
                      sums + begin * field_count);
  }
}

void TileBackward::takeOffInDouble(const Tile& tile, uint32_t x, uint32_t y, float* sums,
                                   double* background) {
  blended_.clear();
  PixelBlend<double> blend;
  for (size_t place = 0; place < tile.splats.size() && !blend.finished; ++place) {
    const VisibleSplat& splat = visible_[tile.splats[place]];
    const Footprint<double>& f = splat.footprint;
    const double dx = tile.x0 + x + 0.5 - f.mean_x;
    const double dy = tile.y0 + y + 0.5 - f.mean_y;
    const double half_squared_distance = halfSquaredDistance(f, dx, dy);
    const double alpha = splatAlpha(f.opacity, half_squared_distance);
    if (!(alpha > 0)) continue;
    blend.add(alpha, splat.colour, static_cast<double>(splat.depth));
    if (blend.finished) break;
    const bool held = !(f.opacity * std::exp(-half_squared_distance) < kMaxAlpha);
    blended_.push_back({static_cast<uint32_t>(place), held, alpha, kGScale * (f.l00 * dx),
                        kGScale * (f.l10 * dx + f.l11 * dy)});
  }

  const PixelLoss<double> loss =
      lossAt(*loss_, static_cast<size_t>(tile.y0 + y) * loss_->width + tile.x0 + x);
  for (size_t c = 0; c < 3; ++c) background[c] += blend.transmittance * loss.gradient[c];
  PixelBackward<double> pixel = startBehind(*loss_, loss, blend.transmittance);
  const size_t field_count = backwardFieldCount(loss_->mode);
  for (size_t k = blended_.size(); k-- > 0;) {
    const Blended& blended = blended_[k];
    const VisibleSplat& splat = visible_[tile.splats[blended.place]];
    const Footprint<double>& f = splat.footprint;
    SplatAtPixel<double> here = {blended.alpha,   blended.held,    blended.g0,      blended.g1,
                                 kGScale * f.l00, kGScale * f.l10, kGScale * f.l11, {}};
    std::copy(splat.colour, splat.colour + 3, here.colour);
    double one[kStatisticsFieldCount] = {};
    stipple::takeOff(here, loss, loss_->mode, pixel, one);
    float* all = sums + blended.place * field_count;
    for (size_t field = 0; field < field_count; ++field) {
      const float value = storedGradient(one[field]);
      all[field] = field == kFieldLargestError ? std::max(all[field], value) : all[field] + value;
    }
  }
}

void TileBackward::run(const Tile& tile, float* sums, double* background) {
  const size_t field_count = backwardFieldCount(loss_->mode);
  clearPixels(tile);
  const size_t used = mark(tile);
  prepareTakeOff(tile, background);
  std::fill(sums + used * field_count, sums + tile.splats.size() * field_count, 0.0f);
  takeOff(tile, used, sums);
  for (uint32_t y = 0; y < tile.height; ++y) {
    for (uint32_t x = 0; x < tile.width; ++x) {
      if (pixels_->doubt[static_cast<size_t>(y) * kTileSide + x] != 0.0f) {
        takeOffInDouble(tile, x, y, sums, background);
      }
    }
  }
}

}  // namespace stipple
