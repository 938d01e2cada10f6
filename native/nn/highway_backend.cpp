#include "nn/highway_backend.h"

#include <algorithm>

#include "base/error.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/kernels/panel_kernel.h"

namespace stipple {

namespace {

class HighwayBackend : public MatrixBackend {
 public:
  const char* name() const override { return "highway"; }
  std::string instructionSets() const override { return chosenPanelKernel().target; }
  bool has(FactorPrecision precision) const override {
    return precision == FactorPrecision::kFloat32;
  }

  size_t packedSize(size_t inputs, size_t outputs, FactorPrecision) const override {
    return stripFloats(chosenPanelKernel().strip, inputs, outputs);
  }

  void pack(const WeightTensor& weight, size_t inputs, size_t first_output, size_t outputs,
            FactorPrecision, float* packed) const override {
    // Numbers of a row that are widened at a time.
    constexpr size_t kPiece = 64;
    float piece[kPiece];
    const size_t strip = chosenPanelKernel().strip;
    const auto widen = chosenLayerKernel().widen;
    const uint64_t bytes = bytesOfNumber(weight.type);
    for (size_t first = 0; first < outputs; first += strip) {
      const size_t count = std::min(strip, outputs - first);
      if (count < strip) std::fill_n(packed, inputs * strip, 0.0f);
      for (size_t begin = 0; begin < inputs; begin += kPiece) {
        const size_t width = std::min(kPiece, inputs - begin);
        for (size_t c = 0; c < count; ++c) {
          const size_t number = (first_output + first + c) * inputs + begin;
          widen(weight.type, width, weight.bytes + number * bytes, piece);
          for (size_t k = 0; k < width; ++k) packed[(begin + k) * strip + c] = piece[k];
        }
      }
      packed += inputs * strip;
    }
  }

  void packTurned(const uint16_t*, size_t, size_t, size_t, float*) const override {
    fail(ErrorCode::kInternal, "highway has no products in bfloat16");
  }

  void multiply(const LinearPanel& panel, const float* packed, FactorPrecision) const override {
    PanelProduct product;
    product.shape = {panel.rows, panel.inputs, panel.outputs};
    product.a = panel.in;
    product.a_stride = panel.in_stride;
    product.b = packed;
    product.bias = panel.bias;
    product.c = panel.out;
    product.c_stride = panel.out_stride;
    chosenPanelKernel().multiply(product);
  }
};

}  // namespace

const MatrixBackend& highwayBackend() {
  static const HighwayBackend backend;
  return backend;
}

}  // namespace stipple
