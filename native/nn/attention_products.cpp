#include "nn/attention_products.h"

#include <algorithm>

#include "nn/kernels/panel_kernel.h"
#include "nn/matrix_backend.h"
#include "nn/scratch.h"

namespace stipple {

namespace {

/// A cache line.
size_t lines(size_t floats) {
  return (floats + 15) / 16 * 16;
}

/// A tile of scores takes 120 KiB and stays in a second cache; queries are a multiple of the rows
/// that kernels take at once (12).
class PanelProducts : public AttentionProducts {
 public:
  explicit PanelProducts(size_t head_width) : width_(head_width) {}
  size_t mostQueries() const override { return 120; }
  size_t mostKeys() const override { return 256; }
  bool takesNarrow() const override { return false; }

  size_t packedFloats(size_t keys) const override {
    return keysFloats(keys) + lines(stripFloats(kernel_.strip, keys, width_));
  }

  void pack(size_t keys, const float* k, size_t k_stride, const float* v, size_t v_stride,
            float* packed) const override {
    packColumns(kernel_.strip, width_, keys, k, k_stride, packed);
    packRows(kernel_.strip, keys, width_, v, v_stride, packed + keysFloats(keys));
  }

  void score(size_t queries, size_t keys, const float* q, size_t q_stride, const float* packed,
             float* scores) const override {
    PanelProduct product;
    product.shape = {queries, width_, keys};
    product.a = q;
    product.a_stride = q_stride;
    product.b = packed;
    product.c = scores;
    product.c_stride = keys;
    kernel_.multiply(product);
  }

  void weigh(size_t queries, size_t keys, const void* weights, const float* packed, bool has_begun,
             float* sums) const override {
    PanelProduct product;
    product.shape = {queries, keys, width_};
    product.a = static_cast<const float*>(weights);
    product.a_stride = keys;
    product.b = packed + keysFloats(keys);
    product.start = has_begun ? PanelStart::kSums : PanelStart::kBias;
    product.c = sums;
    product.c_stride = width_;
    kernel_.multiply(product);
  }

 private:
  size_t keysFloats(size_t keys) const { return lines(stripFloats(kernel_.strip, width_, keys)); }

  const PanelKernel& kernel_ = chosenPanelKernel();
  size_t width_;
};

/// In bfloat16. Keys are a weight that queries are multiplied by; values, transposed, one that
/// weights of keys are. Tiles are larger, because a call of a backend costs about 2 microseconds.
class BackendProducts : public AttentionProducts {
 public:
  BackendProducts(const MatrixBackend& backend, size_t head_width)
      : backend_(backend), width_(head_width) {}
  size_t mostQueries() const override { return 192; }
  size_t mostKeys() const override { return 1024; }
  bool takesNarrow() const override { return true; }

  size_t packedFloats(size_t keys) const override {
    return keysFloats(keys) + lines(backend_.packedSize(keys, width_, kNarrow));
  }

  void pack(size_t keys, const float* k, size_t k_stride, const float* v, size_t v_stride,
            float* packed) const override {
    Scratch room(keys * width_);
    float* rows = room.data();
    for (size_t i = 0; i < keys; ++i) std::copy_n(k + i * k_stride, width_, rows + i * width_);
    backend_.pack(tensorOf(rows), width_, 0, keys, kNarrow, packed);
    for (size_t first = 0; first < keys; first += kTurned) {
      const size_t end = std::min(keys, first + kTurned);
      for (size_t j = 0; j < width_; ++j) {
        for (size_t i = first; i < end; ++i) rows[j * keys + i] = v[i * v_stride + j];
      }
    }
    backend_.pack(tensorOf(rows), keys, 0, width_, kNarrow, packed + keysFloats(keys));
  }

  void score(size_t queries, size_t keys, const float* q, size_t q_stride, const float* packed,
             float* scores) const override {
    LinearPanel panel;
    panel.rows = queries;
    panel.inputs = width_;
    panel.outputs = keys;
    panel.in = q;
    panel.in_stride = q_stride;
    panel.out = scores;
    panel.out_stride = keys;
    backend_.multiply(panel, packed, kNarrow);
  }

  void weigh(size_t queries, size_t keys, const void* weights, const float* packed, bool has_begun,
             float* sums) const override {
    Scratch room(has_begun ? queries * width_ : 0);
    LinearPanel panel;
    panel.rows = queries;
    panel.inputs = keys;
    panel.outputs = width_;
    panel.narrow_in = static_cast<const uint16_t*>(weights);
    panel.in_stride = keys;
    panel.out = has_begun ? room.data() : sums;
    panel.out_stride = width_;
    backend_.multiply(panel, packed + keysFloats(keys), kNarrow);
    if (!has_begun) return;
    for (size_t i = 0; i < queries * width_; ++i) sums[i] += room.data()[i];
  }

 private:
  static constexpr FactorPrecision kNarrow = FactorPrecision::kBfloat16;
  /// Keys of a piece that is turned while it lies in the first cache.
  static constexpr size_t kTurned = 16;

  static WeightTensor tensorOf(const float* values) {
    return {WeightType::kFloat32, "F32", {}, reinterpret_cast<const uint8_t*>(values)};
  }
  size_t keysFloats(size_t keys) const { return lines(backend_.packedSize(width_, keys, kNarrow)); }

  const MatrixBackend& backend_;
  size_t width_;
};

}  // namespace

std::unique_ptr<AttentionProducts> makeAttentionProducts(const NetworkRun& run, size_t head_width) {
  if (precisionOf(run) == FactorPrecision::kFloat32)
    return std::make_unique<PanelProducts>(head_width);
  return std::make_unique<BackendProducts>(backendOf(run), head_width);
}

}  // namespace stipple
