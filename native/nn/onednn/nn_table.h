#pragma once

#include <cstdint>

/// The private table of calls between libstipple and libstipple_nn: plain C data only, so that
/// neither side sees an exception or a type of the other's libraries. Both are built together; the
/// version guards against a file left over from another build.

namespace stipple {

constexpr uint32_t kNnTableVersion = 3;

extern "C" {

/// What went wrong: code is an ErrorCode, 0 for success.
struct StippleNnStatus {
  int32_t code;
  char message[1000];
};

/// In which numbers factors are multiplied.
enum StippleNnPrecision : uint32_t {
  kNnFloat32 = 0,
  kNnBfloat16 = 1,
};

/// A weight [outputs, inputs]: its packed form is chosen by these numbers alone.
struct StippleNnWeight {
  uint64_t inputs;
  uint64_t outputs;
  uint32_t precision;  ///< StippleNnPrecision
};

/// out [rows, outputs] = in [rows, inputs] weight^T + bias.
struct StippleNnProduct {
  uint64_t rows;
  const void* in;     ///< in the precision of the weight, without gaps
  const float* bias;  ///< [outputs], or null
  float* out;
  uint64_t out_stride;  ///< floats from row to row
};

struct StippleNnTable {
  uint32_t version;
  /// The best instruction set in use, for people: "avx512_core_bf16".
  const char* (*instruction_set)(void);
  /// 1 where the processor multiplies in this precision itself.
  uint32_t (*has_precision)(uint32_t precision);
  /// Bytes of a packed weight.
  uint64_t (*packed_bytes)(const StippleNnWeight* weight, StippleNnStatus* status);
  /// In: values [outputs, inputs] in the precision of the weight. Out: packed [packed_bytes].
  void (*pack)(const StippleNnWeight* weight, const void* values, void* packed,
               StippleNnStatus* status);
  /// The same of values that lie as [inputs, outputs], `stride` numbers from row to row.
  void (*pack_turned)(const StippleNnWeight* weight, const void* values, uint64_t stride,
                      void* packed, StippleNnStatus* status);
  /// On the calling thread alone.
  void (*multiply)(const StippleNnWeight* weight, const StippleNnProduct* product,
                   const void* packed, StippleNnStatus* status);
};

/// The one function that libstipple_nn exports: null for another version.
typedef const StippleNnTable* (*StippleNnTableFunction)(uint32_t version);

}  // extern "C"

}  // namespace stipple
