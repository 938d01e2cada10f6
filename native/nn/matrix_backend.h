#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "data/weight_table.h"
#include "nn/network_run.h"

namespace stipple {

/// out [rows, outputs] = in [rows, inputs] weightᵀ + bias, for one panel of outputs.
struct LinearPanel {
  size_t rows = 0;
  size_t inputs = 0;
  size_t outputs = 0;
  const float* in = nullptr;
  size_t in_stride = 0;
  /// The same rounded to bfloat16, rows without gaps, where the caller has it: products in bfloat16
  /// then read it in place of `in`.
  const uint16_t* narrow_in = nullptr;
  const float* bias = nullptr;  ///< [outputs], or null for none
  float* out = nullptr;
  size_t out_stride = 0;
};

/// What multiplies matrices for networks. Every member works on the calling thread alone; layers
/// cut their work into panels and run those in parallel, so that no second pool of threads lives
/// inside Blender.
class MatrixBackend {
 public:
  virtual ~MatrixBackend() = default;
  virtual const char* name() const = 0;             ///< "highway", "onednn"
  virtual std::string instructionSets() const = 0;  ///< what is in use: "AVX3_ZEN4"
  virtual bool has(FactorPrecision precision) const = 0;
  /// Floats that packed weights of [outputs, inputs] take.
  virtual size_t packedSize(size_t inputs, size_t outputs, FactorPrecision precision) const = 0;
  /// Brings rows [first_output, first_output + outputs) of a weight into the form that multiply()
  /// wants. Out: packed [packedSize()].
  virtual void pack(const WeightTensor& weight, size_t inputs, size_t first_output, size_t outputs,
                    FactorPrecision precision, float* packed) const = 0;
  /// The same of a weight in bfloat16 that lies turned around, [inputs, outputs] with `stride`
  /// numbers from row to row, where the backend has products in bfloat16.
  virtual void packTurned(const uint16_t* weight, size_t stride, size_t inputs, size_t outputs,
                          float* packed) const = 0;
  virtual void multiply(const LinearPanel& panel, const float* packed,
                        FactorPrecision precision) const = 0;
};

/// oneDNN's where libstipple_nn.so can be loaded, else ours; or the one that the environment
/// variable STIPPLE_MATRIX_BACKEND names.
const MatrixBackend& defaultMatrixBackend();
/// The backend of a run, and the precision that it has of the one that the run asks for: float32
/// where it has no other.
const MatrixBackend& backendOf(const NetworkRun& run);
FactorPrecision precisionOf(const NetworkRun& run);
/// Errors: kUnavailable, with the reason, where the default backend does not have it.
void requirePrecision(FactorPrecision precision);
/// All that work here, ours first: for tests and benchmarks.
std::span<const MatrixBackend* const> matrixBackends();

}  // namespace stipple
