#include "splat/cpu/tiles/tile_backward.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>

// As in cpu/tiled_render.cpp, what float32 rounding could decide is decided in double: whether a
// splat shows, on the spot; pixels whose end was in doubt, as a whole. So every decision is the
// renderer's.

namespace stipple {

namespace {

constexpr size_t kBatchSize = 128;
/// At least ln(1e-4)/ln(1 - 1/255): more splats cannot blend before a pixel ends.
constexpr size_t kMostBlended = 2352;
constexpr double kGScale = 0.84932180028801904;  // sqrt(log2(e)/2): g = this times L d
constexpr double kLargestSum = 3.4e38;
constexpr uint32_t kSignBit = 0x80000000u;

double valueAt(std::span<const float> values, size_t index, double otherwise) {
  return values.empty() ? otherwise : static_cast<double>(values[index]);
}

/// The sign bit is set where |value| is above kLargestInput, infinite or not a number. By bits:
/// comparing NaN would raise a trap.
constexpr auto kTooLarge = [](float value) {
  return std::bit_cast<uint32_t>(kLargestInput) - (std::bit_cast<uint32_t>(value) & ~kSignBit);
};

/// The same where the value is below 0 (or -0, which a slower check lets pass).
constexpr auto kTooLargeOrNegative = [](float value) {
  return kTooLarge(value) | (std::bit_cast<uint32_t>(value) & kSignBit);
};

/// Without depth.
PixelLoss<double> lossAt(const PictureLoss& picture, size_t pixel) {
  const BackwardInput& input = *picture.input;
  PixelLoss<double> loss{};
  if (picture.wants.mode == BackwardMode::kWeights) return loss;
  for (size_t c = 0; c < 4; ++c) {
    loss.gradient[c] = static_cast<double>(input.colour_gradient[pixel * 4 + c]);
  }
  if (picture.picture->with_background) loss.gradient[3] = 0.0;
  loss.gradient[3] += input.coverage_gradient;
  if (picture.wants.mode == BackwardMode::kGradients) return loss;
  loss.edge = valueAt(input.edge_weights, pixel, 0.0);
  if (picture.wants.mode == BackwardMode::kEdges) return loss;
  const double weight = valueAt(input.residual_weights, pixel, 1.0);
  for (size_t c = 0; c < 3; ++c) {
    const double residual = valueAt(input.residual, pixel * 3 + c, 0.0);
    loss.signed_weight[c] = residual < 0.0 ? -weight : weight;
    loss.room[c] = 2.0 * weight * std::abs(residual);
  }
  loss.error = valueAt(input.errors, pixel, 0.0);
  return loss;
}

size_t pixelOf(const PictureLoss& loss, const Tile& tile, uint32_t x, uint32_t y) {
  return static_cast<size_t>(tile.y0 + y) * loss.picture->width + tile.x0 + x;
}

/// Returns alpha, 0 where the splat is skipped.
double splatAt(const SplatSlots& slots, uint32_t slot, const Tile& tile, uint32_t x, uint32_t y,
               SplatAtPixel<double>& here) {
  here.alpha = alphaInDouble(slots, slot, tile, x, y);
  if (!(here.alpha > 0)) return 0;
  const VisibleSplat& splat = slots.splats[slot];
  const Footprint<double> f = slots.footprint(slot);
  const double dx = tile.x0 + x + 0.5 - f.mean_x;
  const double dy = tile.y0 + y + 0.5 - f.mean_y;
  here.held = !(f.opacity * std::exp(-halfSquaredDistance(f, dx, dy)) < kMaxAlpha);
  here.l00 = kGScale * f.l00;
  here.l10 = kGScale * f.l10;
  here.l11 = kGScale * f.l11;
  here.g0 = here.l00 * dx;
  here.g1 = here.l10 * dx + here.l11 * dy;
  std::copy(splat.colour, splat.colour + 3, here.colour);
  here.depth = static_cast<double>(splat.depth);
  return here.alpha;
}

/// Takes the splat off and adds to the entry's float sums.
void takeOffOne(const SplatAtPixel<double>& here, const PixelLoss<double>& loss,
                BackwardWants wants, PixelBackward<double>& pixel, float* sums) {
  double one[kMostFields] = {};
  takeOff(here, loss, wants, pixel, one);
  for (size_t field = 0; field < backwardFieldCount(wants); ++field) {
    const float value = static_cast<float>(std::clamp(one[field], -kLargestSum, kLargestSum));
    const bool is_largest = wants.mode == BackwardMode::kStatistics && field == kFieldLargestError;
    sums[field] = is_largest ? std::max(sums[field], value) : sums[field] + value;
  }
}

}  // namespace

TileBackward::TileBackward() : pixels_(std::make_unique<BackwardPixels>()), splats_(kBatchSize) {
  blended_.reserve(kMostBlended);
}

void TileBackward::begin(const BackwardKernel& kernel, const SplatSlots& slots,
                         const PictureLoss& loss) {
  kernel_ = &kernel;
  slots_ = slots;
  loss_ = &loss;
  input_is_good_ = true;
}

uint64_t TileBackward::memoryBound() {
  return sizeof(BackwardPixels) + kBatchSize * sizeof(TileSplat) + kMostBlended * sizeof(Blended);
}

/// What the picture left behind. Returns how many splats of the list some pixel may show.
uint32_t TileBackward::takeState(const Tile& tile, size_t index) {
  BackwardPixels& pixels = *pixels_;
  const KeptPicture& kept = *loss_->picture;
  const size_t first = index * kTilePixelCount;
  std::copy_n(kept.transmittance.get() + first, kTilePixelCount, pixels.transmittance);
  std::copy_n(kept.ends.get() + first, kTilePixelCount, pixels.end);
  int32_t most = 0;
  int32_t least = 0;
  for (uint32_t y = 0; y < kTileSide; ++y) {
    int32_t row_end = 0;
    for (uint32_t x = 0; x < kTileSide; ++x) {
      row_end = std::max(row_end, pixels.end[y * kTileSide + x]);
      least = std::min(least, pixels.end[y * kTileSide + x]);
    }
    pixels.row_end[y] = row_end;
    most = std::max(most, row_end);
  }
  has_doubt_ = least < 0;
  return static_cast<uint32_t>(std::min<size_t>(static_cast<size_t>(most), tile.splats.size()));
}

/// Values are looked at before they are used: infinity times 0 would raise a trap.
bool TileBackward::lossIsGood(const Tile& tile) const {
  const BackwardInput& input = *loss_->input;
  uint32_t bad = 0;
  const auto look = [&](std::span<const float> values, size_t channels, auto judge_value) {
    if (values.empty()) return;
    for (uint32_t y = 0; y < tile.height; ++y) {
      const float* row = &values[pixelOf(*loss_, tile, 0, y) * channels];
      uint32_t bad_row = 0;
      for (size_t i = 0; i < tile.width * channels; ++i) bad_row |= judge_value(row[i]);
      bad |= bad_row;
    }
  };
  look(input.colour_gradient, 4, kTooLarge);
  look(input.depth_gradient, 1, kTooLarge);
  look(input.residual, 3, kTooLarge);
  look(input.residual_weights, 1, kTooLargeOrNegative);
  look(input.edge_weights, 1, kTooLarge);
  look(input.errors, 1, kTooLargeOrNegative);
  return !(bad & kSignBit);
}

void TileBackward::takeLoss(const Tile& tile, size_t index, double* background) {
  BackwardPixels& pixels = *pixels_;
  const KeptPicture& kept = *loss_->picture;
  const BackwardInput& input = *loss_->input;
  for (uint32_t y = 0; y < tile.height; ++y) {
    const size_t row = static_cast<size_t>(y) * kTileSide;
    const float* gradient = &input.colour_gradient[pixelOf(*loss_, tile, 0, y) * 4];
    for (uint32_t x = 0; x < tile.width; ++x) {
      pixels.gradient[0][row + x] = gradient[x * 4];
      pixels.gradient[1][row + x] = gradient[x * 4 + 1];
      pixels.gradient[2][row + x] = gradient[x * 4 + 2];
      pixels.gradient[3][row + x] = gradient[x * 4 + 3];
    }
  }
  std::fill(std::begin(pixels.behind), std::end(pixels.behind), 0.0f);
  if (kept.with_background) {
    std::fill(std::begin(pixels.gradient[3]), std::end(pixels.gradient[3]), 0.0f);
    for (size_t c = 0; c < 3; ++c) {
      const float colour = static_cast<float>(kept.background[c]);
      float seen[kTileSide] = {};  // by column
      for (uint32_t y = 0; y < tile.height; ++y) {
        const size_t row = static_cast<size_t>(y) * kTileSide;
        for (uint32_t x = 0; x < tile.width; ++x) {
          pixels.behind[row + x] += colour * pixels.gradient[c][row + x];
          seen[x] += pixels.transmittance[row + x] * pixels.gradient[c][row + x];
        }
      }
      for (const float value : seen) background[c] += static_cast<double>(value);
    }
  }
  if (input.coverage_gradient != 0) {
    const float by_coverage = static_cast<float>(input.coverage_gradient);
    for (float& value : pixels.gradient[3]) value += by_coverage;
  }
  if (loss_->wants.depth) {
    std::copy_n(kept.depth.get() + index * kTilePixelCount, kTilePixelCount, pixels.depth);
    for (uint32_t y = 0; y < tile.height; ++y) {
      const float* gradient = &input.depth_gradient[pixelOf(*loss_, tile, 0, y)];
      for (uint32_t x = 0; x < tile.width; ++x) {
        const size_t i = static_cast<size_t>(y) * kTileSide + x;
        const float coverage = 1.0f - pixels.transmittance[i];
        pixels.depth_gradient[i] = coverage > 0 ? gradient[x] / coverage : 0.0f;
      }
    }
  }
}

/// Loops over plain arrays, one output each, so that the compiler makes vectors.
void TileBackward::takeStatistics(const Tile& tile) {
  BackwardPixels& pixels = *pixels_;
  const KeptPicture& kept = *loss_->picture;
  const BackwardInput& input = *loss_->input;
  float ones[kTileSide];
  std::fill_n(ones, kTileSide, 1.0f);
  const auto copyRow = [&](std::span<const float> from, size_t pixel, float* to) {
    if (from.empty()) {
      std::fill_n(to, tile.width, 0.0f);
    } else {
      std::copy_n(&from[pixel], tile.width, to);
    }
  };
  for (uint32_t y = 0; y < tile.height; ++y) {
    const size_t row = static_cast<size_t>(y) * kTileSide;
    const size_t pixel = pixelOf(*loss_, tile, 0, y);
    copyRow(input.edge_weights, pixel, pixels.edge + row);
    if (loss_->wants.mode == BackwardMode::kEdges) continue;
    copyRow(input.errors, pixel, pixels.error + row);
    const float* weights = input.residual_weights.empty() ? ones : &input.residual_weights[pixel];
    for (size_t c = 0; c < 3; ++c) {
      float* signed_weight = pixels.signed_weight[c] + row;
      float* room = pixels.room[c] + row;
      float* behind = pixels.signed_behind[c] + row;
      if (input.residual.empty()) {
        for (float* plane : {signed_weight, room, behind}) std::fill_n(plane, tile.width, 0.0f);
        continue;
      }
      const float* residual = &input.residual[pixel * 3 + c];
      const float colour = kept.with_background ? static_cast<float>(kept.background[c]) : 0.0f;
      for (uint32_t x = 0; x < tile.width; ++x) {
        // The sign of a residual of 0 does not matter: min(x, 0 - x) is the same for x and -x.
        const uint32_t sign = std::bit_cast<uint32_t>(residual[x * 3]) & kSignBit;
        signed_weight[x] = std::bit_cast<float>(std::bit_cast<uint32_t>(weights[x]) ^ sign);
      }
      for (uint32_t x = 0; x < tile.width; ++x) {
        room[x] = 2.0f * weights[x] * std::abs(residual[x * 3]);
      }
      for (uint32_t x = 0; x < tile.width; ++x) behind[x] = signed_weight[x] * colour;
    }
  }
}

/// One splat at one pixel whose other splats are taken off in float32.
void TileBackward::judge(const void* context, size_t splat, uint32_t pixel, BackwardPixels& pixels,
                         float* sums) {
  const Judged& judged = *static_cast<const Judged*>(context);
  const TileBackward& self = *judged.self;
  const uint32_t x = pixel % kTileSide;
  const uint32_t y = pixel / kTileSide;
  SplatAtPixel<double> here;
  const uint32_t index = judged.tile->splats[judged.begin + splat];
  if (!(splatAt(self.slots_, index, *judged.tile, x, y, here) > 0)) return;
  PixelLoss<double> loss = lossAt(*self.loss_, pixelOf(*self.loss_, *judged.tile, x, y));
  loss.depth = static_cast<double>(pixels.depth[pixel]);
  loss.depth_gradient = static_cast<double>(pixels.depth_gradient[pixel]);
  PixelBackward<double> state;
  state.transmittance = static_cast<double>(pixels.transmittance[pixel]);
  state.behind = static_cast<double>(pixels.behind[pixel]);
  for (size_t c = 0; c < 3; ++c) {
    state.signed_behind[c] = static_cast<double>(pixels.signed_behind[c][pixel]);
  }
  takeOffOne(here, loss, self.loss_->wants, state, sums);
  pixels.transmittance[pixel] = static_cast<float>(state.transmittance);
  pixels.behind[pixel] = static_cast<float>(state.behind);
  for (size_t c = 0; c < 3; ++c) {
    pixels.signed_behind[c][pixel] = static_cast<float>(state.signed_behind[c]);
  }
}

/// Rows of the derivative lie a picture's width apart, so the processor does not foresee them.
void TileBackward::askForPixels(const Tile& tile) const {
  constexpr size_t kLineFloats = 16;
  if (loss_->input->colour_gradient.empty()) return;
  for (uint32_t y = 0; y < tile.height; ++y) {
    const float* row = &loss_->input->colour_gradient[pixelOf(*loss_, tile, 0, y) * 4];
    for (size_t i = 0; i < tile.width * 4; i += kLineFloats) __builtin_prefetch(row + i);
  }
}

/// The batch of a tile that is taken off first.
WantedNext TileBackward::lastBatch(const Tile& tile, size_t index) const {
  const int32_t* ends = loss_->picture->ends.get() + index * kTilePixelCount;
  const int32_t most = *std::max_element(ends, ends + kTilePixelCount);
  const size_t used = std::min(static_cast<size_t>(std::max(most, 0)), tile.splats.size());
  if (used == 0) return {};
  const size_t begin = (used - 1) / kBatchSize * kBatchSize;
  return {slots_.splats, tile.splats.data() + begin, used - begin};
}

void TileBackward::takeOff(const Tile& tile, size_t used, WantedNext next, float* sums) {
  const size_t field_count = backwardFieldCount(loss_->wants);
  Judged judged{this, &tile, 0};
  TakeOffOptions options{loss_->wants, 0, judge, &judged};
  for (size_t batch = (used + kBatchSize - 1) / kBatchSize; batch-- > 0;) {
    const size_t begin = batch * kBatchSize;
    const size_t count = std::min(kBatchSize, used - begin);
    float largest = 0;
    makeTileSplats(slots_.splats, tile, begin, count, largest, splats_.data());
    judged.begin = begin;
    options.first = static_cast<int32_t>(begin);
    options.next =
        batch == 0 ? next : WantedNext{slots_.splats, &tile.splats[begin - kBatchSize], kBatchSize};
    kernel_->take_off(splats_.data(), count, options, *pixels_, sums + begin * field_count);
  }
}

void TileBackward::takeOffInDouble(const Tile& tile, uint32_t x, uint32_t y, float* sums) {
  blended_.clear();
  PixelBlend<double> blend;
  for (size_t place = 0; place < tile.splats.size() && !blend.finished; ++place) {
    Blended one;
    if (!(splatAt(slots_, tile.splats[place], tile, x, y, one.here) > 0)) continue;
    one.place = static_cast<uint32_t>(place);
    blend.add(one.here.alpha, one.here.colour, one.here.depth);
    if (!blend.finished) blended_.push_back(one);
  }

  const size_t pixel = pixelOf(*loss_, tile, x, y);
  PixelLoss<double> loss = lossAt(*loss_, pixel);
  if (loss_->wants.depth && blend.count > 0) {
    const double coverage = 1.0 - blend.transmittance;
    loss.depth = blend.weighted_depth / coverage;
    loss.depth_gradient = static_cast<double>(loss_->input->depth_gradient[pixel]) / coverage;
  }
  PixelBackward<double> state{blend.transmittance, 0.0, {}};
  const KeptPicture& kept = *loss_->picture;
  for (size_t c = 0; kept.with_background && c < 3; ++c) {
    state.behind += kept.background[c] * loss.gradient[c];
    state.signed_behind[c] = kept.background[c] * loss.signed_weight[c];
  }
  const size_t field_count = backwardFieldCount(loss_->wants);
  for (size_t k = blended_.size(); k-- > 0;) {
    takeOffOne(blended_[k].here, loss, loss_->wants, state, sums + blended_[k].place * field_count);
  }
}

uint32_t TileBackward::run(const Tile& tile, size_t index, const Tile* next, float* sums,
                           double* background) {
  const uint32_t used = takeState(tile, index);
  if (!lossIsGood(tile)) input_is_good_ = false;
  if (!input_is_good_) return 0;
  const BackwardMode mode = loss_->wants.mode;
  if (mode != BackwardMode::kWeights) takeLoss(tile, index, background);
  if (mode != BackwardMode::kGradients && mode != BackwardMode::kWeights) takeStatistics(tile);
  WantedNext next_batch;
  if (next) {
    askForPixels(*next);
    next_batch = lastBatch(*next, index + 1);
  }
  takeOff(tile, used, next_batch, sums);
  if (!has_doubt_) return used;
  const size_t field_count = backwardFieldCount(loss_->wants);
  std::fill(sums + used * field_count, sums + tile.splats.size() * field_count, 0.0f);
  for (uint32_t y = 0; y < tile.height; ++y) {
    for (uint32_t x = 0; x < tile.width; ++x) {
      if (pixels_->end[y * kTileSide + x] == kInDoubt) takeOffInDouble(tile, x, y, sums);
    }
  }
  return static_cast<uint32_t>(tile.splats.size());
}

}  // namespace stipple
