#include "nn/onednn_backend.h"

#include <algorithm>
#include <cstdint>
#include <memory>

#include "base/error.h"
#include "base/own_library.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/onednn/nn_table.h"
#include "nn/scratch.h"

namespace stipple {

namespace {

constexpr char kName[] = "stipple_nn";
constexpr char kTableFunction[] = "stipple_nn_table";

void throwIfFailed(const StippleNnStatus& status) {
  if (status.code != 0) fail(static_cast<ErrorCode>(status.code), status.message);
}

class OnednnBackend : public MatrixBackend {
 public:
  explicit OnednnBackend(const StippleNnTable& table) : table_(table) {}

  const char* name() const override { return "onednn"; }
  std::string instructionSets() const override { return table_.instruction_set(); }
  bool has(FactorPrecision precision) const override {
    return table_.has_precision(numberOf(precision)) != 0;
  }

  size_t packedSize(size_t inputs, size_t outputs, FactorPrecision precision) const override {
    if (inputs == 0 || outputs == 0) return 0;
    const StippleNnWeight weight = {inputs, outputs, numberOf(precision)};
    StippleNnStatus status;
    const uint64_t bytes = table_.packed_bytes(&weight, &status);
    throwIfFailed(status);
    return static_cast<size_t>((bytes + sizeof(float) - 1) / sizeof(float));
  }

  void pack(const WeightTensor& tensor, size_t inputs, size_t first_output, size_t outputs,
            FactorPrecision precision, float* packed) const override {
    if (inputs == 0 || outputs == 0) return;
    const StippleNnWeight weight = {inputs, outputs, numberOf(precision)};
    const size_t first = first_output * inputs, count = inputs * outputs;
    const bool as_it_lies = liesAs(tensor, precision);
    Scratch values(as_it_lies ? 0 : count);
    const void* from = values.data();
    if (as_it_lies) {
      from = tensor.bytes + first * (precision == FactorPrecision::kBfloat16 ? 2 : 4);
    } else if (precision == FactorPrecision::kBfloat16) {
      narrow(tensor, first, count, reinterpret_cast<uint16_t*>(values.data()));
    } else {
      widen(tensor, first, {values.data(), count});
    }
    StippleNnStatus status;
    table_.pack(&weight, from, packed, &status);
    throwIfFailed(status);
  }

  void packTurned(const uint16_t* from, size_t stride, size_t inputs, size_t outputs,
                  float* packed) const override {
    if (inputs == 0 || outputs == 0) return;
    const StippleNnWeight weight = {inputs, outputs, kNnBfloat16};
    StippleNnStatus status;
    table_.pack_turned(&weight, from, stride, packed, &status);
    throwIfFailed(status);
  }

  void multiply(const LinearPanel& panel, const float* packed,
                FactorPrecision precision) const override {
    if (panel.rows == 0 || panel.outputs == 0) return;
    if (panel.inputs == 0) return fillWithBias(panel);
    const StippleNnWeight weight = {panel.inputs, panel.outputs, numberOf(precision)};
    const bool is_narrow = precision == FactorPrecision::kBfloat16;
    const bool has_gaps = panel.in_stride != panel.inputs;
    // bfloat16 takes half of it.
    const bool has_narrow = is_narrow && panel.narrow_in != nullptr;
    Scratch rows(!has_narrow && (is_narrow || has_gaps) ? panel.rows * panel.inputs : 0);
    const void* in = panel.in;
    if (has_narrow) {
      in = panel.narrow_in;
    } else if (is_narrow) {
      in = narrowed(panel, reinterpret_cast<uint16_t*>(rows.data()));
    } else if (has_gaps) {
      for (size_t row = 0; row < panel.rows; ++row) {
        std::copy_n(panel.in + row * panel.in_stride, panel.inputs,
                    rows.data() + row * panel.inputs);
      }
      in = rows.data();
    }
    const StippleNnProduct product = {panel.rows, in, panel.bias, panel.out, panel.out_stride};
    StippleNnStatus status;
    table_.multiply(&weight, &product, packed, &status);
    throwIfFailed(status);
  }

 private:
  static uint32_t numberOf(FactorPrecision precision) {
    return precision == FactorPrecision::kBfloat16 ? kNnBfloat16 : kNnFloat32;
  }

  /// Whether oneDNN can read the tensor where it is.
  static bool liesAs(const WeightTensor& tensor, FactorPrecision precision) {
    const bool is_narrow = precision == FactorPrecision::kBfloat16;
    const WeightType type = is_narrow ? WeightType::kBfloat16 : WeightType::kFloat32;
    return tensor.type == type &&
           reinterpret_cast<uintptr_t>(tensor.bytes) % (is_narrow ? 2 : 4) == 0;
  }

  static void narrow(const WeightTensor& tensor, size_t first, size_t count, uint16_t* to) {
    constexpr size_t kPiece = 1024;
    float piece[kPiece];
    const LayerKernel& kernel = chosenLayerKernel();
    for (size_t begin = 0; begin < count; begin += kPiece) {
      const size_t size = std::min(kPiece, count - begin);
      widen(tensor, first + begin, {piece, size});
      kernel.narrow(size, piece, to + begin);
    }
  }

  static const void* narrowed(const LinearPanel& panel, uint16_t* to) {
    const LayerKernel& kernel = chosenLayerKernel();
    for (size_t row = 0; row < panel.rows; ++row) {
      kernel.narrow(panel.inputs, panel.in + row * panel.in_stride, to + row * panel.inputs);
    }
    return to;
  }

  /// The library takes no matrix without columns.
  static void fillWithBias(const LinearPanel& panel) {
    for (size_t row = 0; row < panel.rows; ++row) {
      for (size_t i = 0; i < panel.outputs; ++i) {
        panel.out[row * panel.out_stride + i] = panel.bias == nullptr ? 0.0f : panel.bias[i];
      }
    }
  }

  const StippleNnTable& table_;
};

struct Loaded {
  std::unique_ptr<OnednnBackend> backend;
  std::string why;
};

Loaded load() {
  Loaded loaded;
  std::string path;
  void* library = openOwnLibrary(kName, path, loaded.why);
  if (library == nullptr) return loaded;
  const auto function =
      reinterpret_cast<StippleNnTableFunction>(findInLibrary(library, kTableFunction));
  const StippleNnTable* table = function != nullptr ? function(kNnTableVersion) : nullptr;
  if (table == nullptr) {
    closeOwnLibrary(library);
    loaded.why = path + " belongs to another version; version " + std::to_string(kNnTableVersion) +
                 " of its table is needed";
    return loaded;
  }
  loaded.backend = std::make_unique<OnednnBackend>(*table);
  return loaded;
}

}  // namespace

const MatrixBackend* onednnBackend(std::string* why) {
  static const Loaded& loaded = *new Loaded(load());
  if (why != nullptr) *why = loaded.why;
  return loaded.backend.get();
}

}  // namespace stipple
