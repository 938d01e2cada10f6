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

  void weigh(size_t queries, size_t keys, const float* weights, const float* packed, bool has_begun,
             float* sums) const override {
    PanelProduct product;
    product.shape = {queries, keys, width_};
    product.a = weights;
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

/// Keys are a weight that queries are multiplied by; values, transposed, one that weights of keys
/// are. Tiles are larger, because a call of a backend costs about 2 microseconds.
class BackendProducts : public AttentionProducts {
 public:
  BackendProducts(const MatrixBackend& backend, Precision precision, size_t head_width)
      : backend_(backend), precision_(precision), width_(head_width) {}
  size_t mostQueries() const override { return 192; }
  size_t mostKeys() const override { return 512; }

  size_t packedFloats(size_t keys) const override {
    return keysFloats(keys) + lines(backend_.packedSize(keys, width_, precision_));
  }

  void pack(size_t keys, const float* k, size_t k_stride, const float* v, size_t v_stride,
            float* packed) const override {
    Scratch room(keys * width_);
    float* rows = room.data();
    for (size_t i = 0; i < keys; ++i) std::copy_n(k + i * k_stride, width_, rows + i * width_);
    backend_.pack(tensorOf(rows), width_, 0, keys, precision_, packed);
    for (size_t i = 0; i < keys; ++i) {
      for (size_t j = 0; j < width_; ++j) rows[j * keys + i] = v[i * v_stride + j];
    }
    backend_.pack(tensorOf(rows), keys, 0, width_, precision_, packed + keysFloats(keys));
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
    backend_.multiply(panel, packed, precision_);
  }

  void weigh(size_t queries, size_t keys, const float* weights, const float* packed, bool has_begun,
             float* sums) const override {
    Scratch room(has_begun ? queries * width_ : 0);
    LinearPanel panel;
    panel.rows = queries;
    panel.inputs = keys;
    panel.outputs = width_;
    panel.in = weights;
    panel.in_stride = keys;
    panel.out = has_begun ? room.data() : sums;
    panel.out_stride = width_;
    backend_.multiply(panel, packed + keysFloats(keys), precision_);
    if (!has_begun) return;
    for (size_t i = 0; i < queries * width_; ++i) sums[i] += room.data()[i];
  }

 private:
  static WeightTensor tensorOf(const float* values) {
    return {WeightType::kFloat32, "F32", {}, reinterpret_cast<const uint8_t*>(values)};
  }
  size_t keysFloats(size_t keys) const {
    return lines(backend_.packedSize(width_, keys, precision_));
  }

  const MatrixBackend& backend_;
  Precision precision_;
  size_t width_;
};

}  // namespace

std::unique_ptr<AttentionProducts> makeAttentionProducts(const NetworkRun& run, size_t head_width) {
  const Precision precision = precisionOf(run);
  if (precision == Precision::kFloat32) return std::make_unique<PanelProducts>(head_width);
  return std::make_unique<BackendProducts>(backendOf(run), precision, head_width);
}

}  // namespace stipple
