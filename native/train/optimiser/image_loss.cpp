// Based on: Wang, Bovik, Sheikh, Simoncelli, Image Quality Assessment: From Error Visibility to
// Structural Similarity, IEEE TIP 2004, equation 13; Kerbl et al., 3D Gaussian Splatting for
// Real-Time Radiance Field Rendering, SIGGRAPH 2023, equation 7 (L1 and D-SSIM, lambda = 0.2).
// Differs: from the second on everything is written in rendered + target and rendered - target, so
// that four blurs do instead of five, nothing cancels where the pictures agree, and three blurs
// give the gradient (G is symmetric, so its transpose with zeros outside is itself).
//
// A tile streams through its rows, four at a time. A ring keeps its last picture rows; they give
// the statistics five rows up, whose maps go to a second ring, and those give the gradient another
// five rows up. Maps within five pixels of a tile are computed by both neighbours.

#include "train/optimiser/image_loss.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <mutex>
#include <string>
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "train/optimiser/image_loss_kernel.h"

namespace stipple {

namespace {

// Tiles of about this size share little work with their neighbours (15 % of the maps), and their
// rings (0.5 MB) stay in a core's second cache.
constexpr size_t kTileWidth = 256;
constexpr size_t kTileHeight = 96;
/// Rows in a ring. When the maps of a block are done, 5 + 3 rows beyond it have been read; the
/// gradient block that waits for them may begin 5 + 3 + 3 rows before their last.
constexpr size_t kRingRows = 20;
static_assert(kRingRows >= 2 * kBlurReach + 2 * kBlockRows);

/// Rows of p and d reach 10 columns beyond the tile, rows of maps 5.
constexpr size_t kPictureReach = 2 * kBlurReach;
constexpr size_t kRowPitch = kTileWidth + 2 * kPictureReach + kRowSlack + 12;
static_assert(kRowPitch % 16 == 0);

struct alignas(64) Row : std::array<float, kRowPitch> {};

struct TileScratch {
  Row sums[kRingRows][3];
  Row differences[kRingRows][3];
  Row maps[kRingRows][3][3];  ///< [row][channel][map]
  Row statistics[kBlockRows][4];
  Row errors;
  Row blurred_maps[3][kBlockRows];
  Row gradient[kBlockRows][3];
  Row weights;
  Row zeros;
};

struct Tile {
  size_t row_begin, row_end, column_begin, column_end;
};

/// Equal parts of at most `largest`.
size_t partSize(size_t count, size_t largest) {
  const size_t parts = (count + largest - 1) / largest;
  return (count + parts - 1) / parts;
}

struct Tiling {
  size_t width, height, tile_width, tile_height;

  Tiling(size_t picture_width, size_t picture_height)
      : width(picture_width),
        height(picture_height),
        tile_width(partSize(picture_width, kTileWidth)),
        tile_height(partSize(picture_height, kTileHeight)) {}
  size_t columns() const { return (width + tile_width - 1) / tile_width; }
  size_t count() const { return columns() * ((height + tile_height - 1) / tile_height); }
  Tile tile(size_t index) const {
    const size_t row = index / columns() * tile_height;
    const size_t column = index % columns() * tile_width;
    return {row, std::min(height, row + tile_height), column, std::min(width, column + tile_width)};
  }
};

struct Task {
  const LossKernel& kernel;
  Tiling tiling;
  PictureView rendered, target;
  const float* weights;
  GradientView gradient;
  float l1_scale, ssim_scale;
  double* row_sums;         ///< [tile column, height, 2]: 1 - SSIM and |x - y|
  float* structure_errors;  ///< [H,W] or null

  template <class View>
  auto run(const View& view, size_t row, size_t column) const {
    const size_t pixel = row * tiling.width + column;
    const size_t step = view.layout == PixelLayout::kRgb    ? 3
                        : view.layout == PixelLayout::kRgba ? 4
                                                            : 1;
    using Float = std::remove_pointer_t<decltype(view.values)>;
    return PixelRun<Float>{view.values + pixel * step, view.layout, tiling.width * tiling.height};
  }
};

/// One tile on its way through the rows.
class TilePass {
 public:
  TilePass(const Task& task, const Tile& tile, TileScratch& scratch)
      : task_(task),
        tile_(tile),
        scratch_(scratch),
        read_begin_(std::max(tile.column_begin, kPictureReach) - kPictureReach),
        read_end_(std::min(task.tiling.width, tile.column_end + kPictureReach)),
        map_begin_(std::max(tile.column_begin, kBlurReach) - kBlurReach),
        map_end_(std::min(task.tiling.width, tile.column_end + kBlurReach)) {}

  /// Returns whether all colours could be used.
  bool run() {
    clearMargins();
    const size_t height = task_.tiling.height;
    const bool with_gradient = task_.gradient.values != nullptr;
    const size_t map_reach = with_gradient ? kBlurReach : 0;
    const size_t first_map = std::max(tile_.row_begin, map_reach) - map_reach;
    const size_t end_map = std::min(height, tile_.row_end + map_reach);
    size_t next_read = std::max(first_map, kBlurReach) - kBlurReach;
    size_t next_gradient = tile_.row_begin;
    bool usable = true;
    for (size_t row = first_map; row < end_map; row += kBlockRows) {
      const size_t end = std::min(end_map, row + kBlockRows);
      for (; next_read < std::min(height, end + kBlurReach); ++next_read) {
        usable = readRow(next_read) && usable;
      }
      mapRows(row, end);
      if (!with_gradient) continue;
      // A block needs the maps of 5 rows beyond it, or as many as there are.
      while (next_gradient < tile_.row_end) {
        const size_t gradient_end = std::min(tile_.row_end, next_gradient + kBlockRows);
        if (std::min(end_map, gradient_end + kBlurReach) > end) break;
        gradientRows(next_gradient, gradient_end, first_map, end_map);
        next_gradient = gradient_end;
      }
    }
    return usable;
  }

 private:
  static size_t slot(size_t row) { return row % kRingRows; }

  /// Columns of working rows that lie outside the picture hold zeros throughout the pass.
  void clearMargins() {
    const size_t tile_width = tile_.column_end - tile_.column_begin;
    const size_t read_left = read_begin_ + kPictureReach - tile_.column_begin;
    const size_t read_right = read_left + read_end_ - read_begin_;
    const size_t map_left = map_begin_ + kBlurReach - tile_.column_begin;
    const size_t map_right = map_left + map_end_ - map_begin_;
    const auto clear = [](Row& row, size_t left, size_t right, size_t end) {
      std::fill_n(row.begin(), left, 0.0f);
      if (right < end) std::fill(row.begin() + right, row.begin() + end, 0.0f);
    };
    for (size_t r = 0; r < kRingRows; ++r) {
      for (size_t c = 0; c < 3; ++c) {
        clear(scratch_.sums[r][c], read_left, read_right, tile_width + 2 * kPictureReach);
        clear(scratch_.differences[r][c], read_left, read_right, tile_width + 2 * kPictureReach);
      }
    }
    map_left_ = map_left;
    map_right_ = map_right;
    map_width_ = tile_width + 2 * kBlurReach;
  }

  bool readRow(size_t row) {
    const size_t left = read_begin_ + kPictureReach - tile_.column_begin;
    float* sums[3];
    float* differences[3];
    for (size_t c = 0; c < 3; ++c) {
      sums[c] = scratch_.sums[slot(row)][c].data() + left;
      differences[c] = scratch_.differences[slot(row)][c].data() + left;
    }
    return task_.kernel.readPixels(task_.run(task_.rendered, row, read_begin_),
                                   task_.run(task_.target, row, read_begin_),
                                   read_end_ - read_begin_, sums, differences);
  }

  /// The tile's weights in a row from `column` on, with slack behind them; null for 1.
  const float* weightsOf(size_t row, size_t column, size_t count) {
    if (!task_.weights) return nullptr;
    std::copy_n(task_.weights + row * task_.tiling.width + column, count, scratch_.weights.begin());
    return scratch_.weights.data();
  }

  /// The 14 rows that a block beginning at `row` is blurred from, zeros outside first..end.
  template <class RowOf>
  std::array<const float*, kBlockInputs> blockInputs(size_t row, size_t first, size_t end,
                                                     const RowOf& rowOf) const {
    std::array<const float*, kBlockInputs> rows;
    for (size_t k = 0; k < kBlockInputs; ++k) {
      const bool inside = row + k >= first + kBlurReach && row + k < end + kBlurReach;
      rows[k] = inside ? rowOf(slot(row + k - kBlurReach)).data() : scratch_.zeros.data();
    }
    return rows;
  }

  /// SSIM and its maps of at most kBlockRows rows.
  void mapRows(size_t begin, size_t end) {
    const size_t readable = std::min(task_.tiling.height, end + kBlurReach);
    for (size_t c = 0; c < 3; ++c) {
      const auto sums =
          blockInputs(begin, 0, readable, [&](size_t s) -> Row& { return scratch_.sums[s][c]; });
      const auto differences = blockInputs(
          begin, 0, readable, [&](size_t s) -> Row& { return scratch_.differences[s][c]; });
      float* statistics[kBlockRows * 4];
      for (size_t s = 0; s < kBlockRows * 4; ++s) {
        statistics[s] = scratch_.statistics[s / 4][s % 4].data();
      }
      task_.kernel.blurStatistics(sums.data(), differences.data(), map_width_ + 2 * kBlurReach,
                                  statistics);
      for (size_t row = begin; row < end; ++row) mapRow(row, c, scratch_.statistics[row - begin]);
    }
  }

  void mapRow(size_t row, size_t c, Row* statistics) {
    const bool own = row >= tile_.row_begin && row < tile_.row_end;
    const size_t own_left = tile_.column_begin - map_begin_;
    const size_t own_count = tile_.column_end - tile_.column_begin;
    const float* weights = weightsOf(row, map_begin_, map_end_ - map_begin_);
    const float* inputs[4];
    for (size_t s = 0; s < 4; ++s) inputs[s] = statistics[s].data() + map_left_;
    float* maps[3] = {};
    if (task_.gradient.values) {
      for (size_t m = 0; m < 3; ++m) maps[m] = scratch_.maps[slot(row)][c][m].data() + map_left_;
    }
    task_.kernel.evaluateSsim(inputs, weights, map_end_ - map_begin_, scratch_.errors.data(), maps);
    if (maps[0]) clearMapMargins(scratch_.maps[slot(row)][c]);
    if (!own) return;
    const size_t tile_column = tile_.column_begin / task_.tiling.tile_width;
    double* sums = task_.row_sums + 2 * (tile_column * task_.tiling.height + row);
    if (c == 0) sums[0] = sums[1] = 0;
    const float* own_weights = weights ? weights + own_left : nullptr;
    if (task_.structure_errors) addErrors(row, c, scratch_.errors.data() + own_left, own_weights);
    const Row& differences = scratch_.differences[slot(row)][c];
    sums[0] +=
        task_.kernel.sumMagnitudes(scratch_.errors.data() + own_left, own_weights, own_count);
    sums[1] +=
        task_.kernel.sumMagnitudes(differences.data() + kPictureReach, own_weights, own_count);
  }

  /// Of one channel; the first one begins the row.
  void addErrors(size_t row, size_t c, const float* errors, const float* weights) {
    const size_t count = tile_.column_end - tile_.column_begin;
    float* out = task_.structure_errors + row * task_.tiling.width + tile_.column_begin;
    for (size_t i = 0; i < count; ++i) {
      // Rounding may leave an error of 0 slightly negative.
      const float error = std::max(0.0f, errors[i]) * (weights ? weights[i] : 1.0f) * (1.0f / 3.0f);
      out[i] = c == 0 ? error : out[i] + error;
    }
  }

  void clearMapMargins(Row* maps) {
    for (size_t m = 0; m < 3; ++m) {
      std::fill_n(maps[m].begin(), map_left_, 0.0f);
      std::fill(maps[m].begin() + map_right_, maps[m].begin() + map_width_, 0.0f);
    }
  }

  /// At most kBlockRows rows of the gradient.
  void gradientRows(size_t begin, size_t end, size_t first_map, size_t end_map) {
    const size_t own_count = tile_.column_end - tile_.column_begin;
    const size_t mapped = std::min(end_map, end + kBlurReach);
    for (size_t c = 0; c < 3; ++c) {
      for (size_t m = 0; m < 3; ++m) {
        const auto maps = blockInputs(begin, first_map, mapped,
                                      [&](size_t s) -> Row& { return scratch_.maps[s][c][m]; });
        float* blurred[kBlockRows];
        for (size_t r = 0; r < kBlockRows; ++r) blurred[r] = scratch_.blurred_maps[m][r].data();
        task_.kernel.blurColumns(maps.data(), map_width_, blurred);
      }
      for (size_t row = begin; row < end; ++row) {
        const float* blurred[3];
        for (size_t m = 0; m < 3; ++m) blurred[m] = scratch_.blurred_maps[m][row - begin].data();
        task_.kernel.combineGradient(blurred, scratch_.sums[slot(row)][c].data() + kPictureReach,
                                     scratch_.differences[slot(row)][c].data() + kPictureReach,
                                     weightsOf(row, tile_.column_begin, own_count), own_count,
                                     task_.l1_scale, task_.ssim_scale,
                                     scratch_.gradient[row - begin][c].data());
      }
    }
    for (size_t row = begin; row < end; ++row) {
      const float* gradient[3];
      for (size_t c = 0; c < 3; ++c) gradient[c] = scratch_.gradient[row - begin][c].data();
      task_.kernel.writePixels(gradient, own_count,
                               task_.run(task_.gradient, row, tile_.column_begin));
    }
  }

  const Task& task_;
  const Tile tile_;
  TileScratch& scratch_;
  const size_t read_begin_, read_end_, map_begin_, map_end_;  ///< columns of the picture
  size_t map_left_ = 0, map_right_ = 0, map_width_ = 0;       ///< in rows of maps
};

/// Names the first colour that cannot be used, if there is one.
void requireUsable(const Task& task, const PictureView& picture, const char* name) {
  for (size_t row = 0; row < task.tiling.height; ++row) {
    for (size_t column = 0; column < task.tiling.width; ++column) {
      const auto pixel = task.run(picture, row, column);
      for (size_t c = 0; c < 3; ++c) {
        const float value =
            pixel.first[pixel.layout == PixelLayout::kPlanar ? c * pixel.plane_stride : c];
        if (std::isfinite(value) && std::abs(value) <= kLargestColour) continue;
        fail(ErrorCode::kInvalidArgument,
             std::string(name) + ": channel " + std::to_string(c) + " of the pixel in row " +
                 std::to_string(row) + ", column " + std::to_string(column) + " is " +
                 std::to_string(value) + "; it must be within -1e6 and 1e6");
      }
    }
  }
}

}  // namespace

struct ImageLoss::Workspace {
  explicit Workspace(const LossKernel& chosen) : kernel(chosen) {}

  /// Before the loop, so that nothing is allocated in it.
  void reserve(const Tiling& tiling, size_t threads) {
    row_sums.resize(2 * tiling.columns() * tiling.height);
    while (scratches.size() < std::min(threads, tiling.count())) {
      scratches.push_back(std::make_unique<TileScratch>());  // value-initialised: all zeros
    }
    idle.clear();
    idle.reserve(scratches.size());
    for (const auto& scratch : scratches) idle.push_back(scratch.get());
  }

  void runTiles(const Task& task, size_t begin, size_t end) {
    TileScratch* scratch = nullptr;
    {
      const std::lock_guard lock(mutex);
      scratch = idle.back();
      idle.pop_back();
    }
    for (size_t i = begin; i < end; ++i) {
      if (!TilePass(task, task.tiling.tile(i), *scratch).run()) all_usable = false;
    }
    const std::lock_guard lock(mutex);
    idle.push_back(scratch);
  }

  /// Gives the sum of all weights; refuses those that are negative, too large or not finite.
  double sumWeights(const float* weights, size_t width, size_t height) {
    weight_sums.resize(height);
    const auto isWeight = [](float weight) {
      return std::isfinite(weight) && weight >= 0 && weight <= kLargestColour;
    };
    const struct {
      const float* weights;
      size_t width;
      double* sums;
    } rows = {weights, width, weight_sums.data()};
    parallelFor(height, 64, [&rows, &isWeight](size_t begin, size_t end) {
      for (size_t row = begin; row < end; ++row) {
        rows.sums[row] = 0;
        for (size_t x = 0; x < rows.width; ++x) {
          const float weight = rows.weights[row * rows.width + x];
          // Below zero: the row holds a weight that is none.
          rows.sums[row] = isWeight(weight) && rows.sums[row] >= 0
                               ? rows.sums[row] + static_cast<double>(weight)
                               : -1.0;
        }
      }
    });
    double sum = 0;
    for (size_t row = 0; row < height; ++row) {
      for (size_t x = 0; weight_sums[row] < 0 && x < width; ++x) {
        const float weight = weights[row * width + x];
        if (isWeight(weight)) continue;
        fail(ErrorCode::kInvalidArgument,
             "weight of the pixel in row " + std::to_string(row) + ", column " + std::to_string(x) +
                 " is " + std::to_string(weight) + "; it must be within 0 and 1e6");
      }
      sum += weight_sums[row];
    }
    return sum;
  }

  const LossKernel kernel;
  std::vector<std::unique_ptr<TileScratch>> scratches;
  std::vector<TileScratch*> idle;
  std::vector<double> row_sums;
  std::vector<double> weight_sums;
  std::vector<float> structure_errors;
  std::mutex mutex;
  std::atomic<bool> all_usable{true};
};

ImageLoss::ImageLoss() : ImageLoss(chosenLossKernel()) {}
ImageLoss::ImageLoss(const LossKernel& kernel) : workspace_(std::make_unique<Workspace>(kernel)) {}
ImageLoss::~ImageLoss() = default;

size_t ImageLoss::workspaceBytes() const {
  return workspace_->scratches.size() * sizeof(TileScratch) +
         (workspace_->row_sums.capacity() + workspace_->weight_sums.capacity()) * sizeof(double) +
         workspace_->structure_errors.capacity() * sizeof(float);
}

std::span<const float> ImageLoss::structureErrors() const {
  return workspace_->structure_errors;
}

ImageLossValue ImageLoss::evaluate(uint32_t width, uint32_t height, PictureView rendered,
                                   PictureView target, const float* weights, GradientView gradient,
                                   const ImageLossOptions& options) {
  const double share = options.ssim_share;
  if (!(share >= 0 && share <= 1)) {
    fail(ErrorCode::kInvalidArgument,
         "ssim_share is " + std::to_string(share) + "; it must be within 0 and 1");
  }
  ImageLossValue value;
  workspace_->structure_errors.resize(
      options.with_structure_errors ? static_cast<size_t>(width) * height : 0);
  if (width == 0 || height == 0) return value;
  if (!rendered.values || !target.values) {
    fail(ErrorCode::kInvalidArgument, "the rendered and the target image must not be null");
  }
  const Tiling tiling(width, height);
  const double weight_sum = weights ? workspace_->sumWeights(weights, width, height)
                                    : static_cast<double>(width) * height;
  const double unit = weight_sum > 0 ? 1 / (3 * weight_sum) : 0.0;
  workspace_->reserve(tiling, threadLimit());
  workspace_->all_usable = true;
  const Task task = {workspace_->kernel,
                     tiling,
                     rendered,
                     target,
                     weights,
                     gradient,
                     static_cast<float>((1 - share) * unit),
                     static_cast<float>(share * unit),
                     workspace_->row_sums.data(),
                     options.with_structure_errors ? workspace_->structure_errors.data() : nullptr};
  Workspace& workspace = *workspace_;
  // Two captured references fit std::function without an allocation.
  parallelFor(tiling.count(), 1, [&workspace, &task](size_t begin, size_t end) {
    workspace.runTiles(task, begin, end);
  });
  if (!workspace.all_usable) {
    requireUsable(task, rendered, "rendered image");
    requireUsable(task, target, "target image");
  }
  double error = 0, magnitude = 0;
  for (size_t i = 0; i < workspace.row_sums.size(); i += 2) {
    error += workspace.row_sums[i];
    magnitude += workspace.row_sums[i + 1];
  }
  value.l1 = magnitude * unit;
  value.ssim = 1 - error * unit;
  value.loss = (1 - share) * value.l1 + share * error * unit;
  return value;
}

}  // namespace stipple
