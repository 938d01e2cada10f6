#include "data/images/hole_fill.h"

#include <algorithm>
#include <utility>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrainRows = 16;

/// Sums of colours times weights, and of weights, over squares of one size.
struct Level {
  size_t width = 0, height = 0;
  std::vector<float> colour;  ///< [H,W,3]
  std::vector<float> weight;  ///< [H,W]
};

Level coarser(const Level& fine) {
  Level made;
  made.width = (fine.width + 1) / 2;
  made.height = (fine.height + 1) / 2;
  made.colour.resize(made.width * made.height * 3);
  made.weight.resize(made.width * made.height);
  parallelFor(made.height, kGrainRows, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      for (size_t x = 0; x < made.width; ++x) {
        const size_t to = y * made.width + x;
        for (size_t row = 2 * y; row < std::min(2 * y + 2, fine.height); ++row) {
          for (size_t column = 2 * x; column < std::min(2 * x + 2, fine.width); ++column) {
            const size_t from = row * fine.width + column;
            made.weight[to] += fine.weight[from];
            for (size_t c = 0; c < 3; ++c) made.colour[to * 3 + c] += fine.colour[from * 3 + c];
          }
        }
      }
    }
  });
  return made;
}

/// Sums become means; squares without a known pixel take the mean of the next coarser level.
void toMeans(Level& level, const Level* coarse) {
  parallelFor(level.height, kGrainRows, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      for (size_t x = 0; x < level.width; ++x) {
        const size_t at = y * level.width + x;
        float* colour = &level.colour[at * 3];
        if (level.weight[at] > 0.0f) {
          for (size_t c = 0; c < 3; ++c) colour[c] /= level.weight[at];
        } else if (coarse) {
          std::copy_n(&coarse->colour[(y / 2 * coarse->width + x / 2) * 3], 3, colour);
        }
      }
    }
  });
}

}  // namespace

std::vector<float> filledHoles(std::span<const float> colour, std::span<const uint8_t> known,
                               uint32_t width, uint32_t height) {
  std::vector<Level> levels(1);
  levels[0].width = width;
  levels[0].height = height;
  levels[0].colour.assign(known.size() * 3, 0.0f);
  levels[0].weight.assign(known.size(), 0.0f);
  for (size_t i = 0; i < known.size(); ++i) {
    if (!known[i]) continue;
    levels[0].weight[i] = 1.0f;
    std::copy_n(&colour[i * 3], 3, &levels[0].colour[i * 3]);
  }
  while (levels.back().width * levels.back().height > 1) levels.push_back(coarser(levels.back()));
  for (size_t i = levels.size(); i-- > 0;) {
    toMeans(levels[i], i + 1 < levels.size() ? &levels[i + 1] : nullptr);
  }
  return std::move(levels[0].colour);
}

}  // namespace stipple
