// Based on: M. Milakov, N. Gimelshein, Online normalizer calculation for softmax, arXiv 1805.02867,
// 2018; DeepSeek-V2, arXiv 2405.04434, section 2.1.2, whose maps of keys and values move to queries
// and results in the same way.
#include "nn/shared_attention.h"

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/kernels/panel_kernel.h"
#include "nn/scratch.h"

namespace stipple {

namespace {

/// Keys of a tile, whose scores for a strip of queries take 16 KiB.
constexpr size_t kTileKeys = 128;

/// c = a b, or added to it: b a strip, c the columns of a strip without gaps.
void multiplyStrip(const PanelKernel& kernel, size_t rows, size_t inner, const float* a,
                   size_t a_stride, const float* b, PanelStart start, float* c) {
  PanelProduct product;
  product.shape = {rows, inner, kernel.strip};
  product.a = a;
  product.a_stride = a_stride;
  product.b = b;
  product.start = start;
  product.c = c;
  product.c_stride = kernel.strip;
  kernel.multiply(product);
}

/// A strip of queries of one head. In: q [queries, heads.width]. Queries are columns throughout, so
/// that rows and maps are used as they lie.
void attendStrip(const SharedHeads& heads, const SharedRows& rows, size_t head, size_t queries,
                 const float* q, size_t stride, float* out) {
  const PanelKernel& kernel = chosenPanelKernel();
  const auto softmax = chosenLayerKernel().softmaxColumns;
  const size_t strip = kernel.strip;
  const size_t mapped = rows.width + 1;
  Scratch room((heads.width + 2 * mapped + kTileKeys + 2) * strip);
  float* wide = room.data();
  float* turned = wide + heads.width * strip;
  float* gathered = turned + mapped * strip;
  float* scores = gathered + mapped * strip;
  float* peaks = scores + kTileKeys * strip;
  float* totals = peaks + strip;
  packColumns(strip, heads.width, queries, q, stride, wide);
  multiplyStrip(kernel, mapped, heads.width, &heads.key_maps[head * mapped * heads.width],
                heads.width, wide, PanelStart::kBias, turned);
  std::fill_n(gathered, mapped * strip, 0.0f);
  std::fill_n(peaks, strip, std::numeric_limits<float>::lowest());
  std::fill_n(totals, strip, 0.0f);
  for (size_t first = 0; first < rows.count; first += kTileKeys) {
    const size_t keys = std::min(kTileKeys, rows.count - first);
    multiplyStrip(kernel, keys, mapped, &rows.rows[first * mapped], mapped, turned,
                  PanelStart::kBias, scores);
    SoftmaxColumns tile;
    tile.scores = scores;
    tile.keys = keys;
    tile.columns = strip;
    tile.rates = &heads.rates[head * rows.count + first];
    tile.peaks = peaks;
    tile.sums = totals;
    tile.out = gathered;
    tile.width = rows.width;
    softmax(tile);
    multiplyStrip(kernel, rows.width, keys, &rows.columns[first], rows.count, scores,
                  PanelStart::kSums, gathered);
  }
  for (size_t c = 0; c < strip; ++c) totals[c] = 1.0f / totals[c];
  for (size_t i = 0; i < rows.width; ++i) {
    for (size_t c = 0; c < strip; ++c) gathered[i * strip + c] *= totals[c];
  }
  // Weights sum to 1, which the values' constant parts are times.
  std::fill_n(gathered + rows.width * strip, strip, 1.0f);
  multiplyStrip(kernel, heads.width, mapped, &heads.value_maps[head * mapped * heads.width], mapped,
                gathered, PanelStart::kBias, wide);
  for (size_t query = 0; query < queries; ++query) {
    float* to = out + query * stride;
    for (size_t i = 0; i < heads.width; ++i) to[i] = wide[i * strip + query];
  }
}

}  // namespace

SharedRows::SharedRows(size_t row_count, size_t row_width, const float* values)
    : count(row_count), width(row_width) {
  rows.reserve(count * (width + 1));
  columns.resize(count * width);
  for (size_t i = 0; i < count; ++i) {
    rows.insert(rows.end(), values + i * width, values + (i + 1) * width);
    rows.push_back(1.0f);
    for (size_t k = 0; k < width; ++k) columns[k * count + i] = values[i * width + k];
  }
}

uint64_t SharedRows::bytes(uint64_t count, uint64_t width) {
  return count * (2 * width + 1) * sizeof(float);
}

void sharedAttention(const NetworkRun& run, const SharedHeads& heads, const SharedRows& rows,
                     size_t queries, const float* q, size_t stride, float* out) {
  if (rows.count == 0) fail(ErrorCode::kInvalidArgument, "an attention has 0 keys; 1 is needed");
  const size_t strip = chosenPanelKernel().strip;
  const size_t strips = rangeCount(queries, strip);
  parallelFor(heads.count * strips, 1, [&](size_t begin, size_t) {
    if (run.progress != nullptr) run.progress->throwIfCancelled();
    const size_t head = begin / strips;
    const size_t first = begin % strips * strip;
    const size_t offset = first * stride + head * heads.width;
    attendStrip(heads, rows, head, std::min(strip, queries - first), q + offset, stride,
                out + offset);
  });
}

}  // namespace stipple
