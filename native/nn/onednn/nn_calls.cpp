// The table of libstipple_nn: products by oneDNN's matmul, whose weights are brought into the form
// that it asks for. Everything runs on the calling thread.
#include <oneapi/dnnl/dnnl.hpp>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <string>

#if DNNL_CPU_THREADING_RUNTIME == DNNL_RUNTIME_OMP
#include <omp.h>
#endif

#include "nn/onednn/nn_table.h"

namespace stipple::onednn {

namespace {

using Type = dnnl::memory::data_type;

// Values of ErrorCode (base/error.h), which is not linked here.
constexpr int32_t kOutOfMemoryCode = 2;
constexpr int32_t kInternalCode = 10;

/// Holds the loops of oneDNN to this thread. OpenMP's number of threads belongs to the thread that
/// sets it, and a team of one starts no pool.
class OneThread {
 public:
#if DNNL_CPU_THREADING_RUNTIME == DNNL_RUNTIME_OMP
  OneThread() : before_(omp_get_max_threads()) {
    omp_set_num_threads(1);
  }
  ~OneThread() {
    omp_set_num_threads(before_);
  }
#else
  OneThread() = default;
#endif
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  [[maybe_unused]] int before_ = 1;
};

/// Memory at a multiple of a cache line that grows and stays with its thread.
class ThreadMemory {
 public:
  void* atLeast(size_t bytes) {
    if (bytes > bytes_) {
      memory_.reset();
      bytes_ = 0;
      const size_t rounded = (bytes + kLine - 1) / kLine * kLine;
      memory_.reset(std::aligned_alloc(kLine, rounded));
      if (memory_ == nullptr) throw std::bad_alloc();
      bytes_ = rounded;
    }
    return memory_.get();
  }

 private:
  static constexpr size_t kLine = 64;
  struct Free {
    void operator()(void* memory) const { std::free(memory); }
  };
  std::unique_ptr<void, Free> memory_;
  size_t bytes_ = 0;
};

const dnnl::engine& engine() {
  static const dnnl::engine engine(dnnl::engine::kind::cpu, 0);
  return engine;
}

/// A stream is not for several threads at once.
dnnl::stream& stream() {
  static thread_local dnnl::stream stream(engine());
  return stream;
}

/// Rows without gaps: with others the version 2 of oneDNN has plain loops alone.
dnnl::memory::desc matrix(uint64_t rows, uint64_t columns, Type type) {
  return {dnnl::memory::dims{static_cast<dnnl::memory::dim>(rows),
                             static_cast<dnnl::memory::dim>(columns)},
          type, dnnl::memory::format_tag::ab};
}

Type typeOf(uint32_t precision) {
  return precision == kNnBfloat16 ? Type::bf16 : Type::f32;
}

/// weight^T [inputs, outputs] as it lies: numbers from input to input, and from output to output.
dnnl::memory::desc transposed(const StippleNnWeight& weight, uint64_t input_stride,
                              uint64_t output_stride) {
  const auto inputs = static_cast<dnnl::memory::dim>(weight.inputs);
  const auto outputs = static_cast<dnnl::memory::dim>(weight.outputs);
  return {dnnl::memory::dims{inputs, outputs}, typeOf(weight.precision),
          dnnl::memory::dims{static_cast<dnnl::memory::dim>(input_stride),
                             static_cast<dnnl::memory::dim>(output_stride)}};
}

dnnl::matmul::primitive_desc describe(const dnnl::memory::desc& in,
                                      const dnnl::memory::desc& weight,
                                      const dnnl::memory::desc* bias,
                                      const dnnl::memory::desc& out) {
  dnnl::primitive_attr attributes;
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
#if DNNL_VERSION_MAJOR >= 3
  if (bias == nullptr) return {engine(), in, weight, out, attributes};
  return {engine(), in, weight, *bias, out, attributes};
#else
  const dnnl::matmul::desc operation = bias == nullptr ? dnnl::matmul::desc(in, weight, out)
                                                       : dnnl::matmul::desc(in, weight, *bias, out);
  return {operation, attributes, engine()};
#endif
}

/// Rows for which the form of a weight is chosen: those of a task of a layer. Other numbers of rows
/// take the same form.
constexpr uint64_t kUsualRows = 192;

dnnl::memory::desc packedForm(const StippleNnWeight& weight) {
  const Type type = typeOf(weight.precision);
  const dnnl::memory::desc any(dnnl::memory::dims{static_cast<dnnl::memory::dim>(weight.inputs),
                                                  static_cast<dnnl::memory::dim>(weight.outputs)},
                               type, dnnl::memory::format_tag::any);
  const dnnl::memory::desc bias = matrix(1, weight.outputs, Type::f32);
  return describe(matrix(kUsualRows, weight.inputs, type), any, &bias,
                  matrix(kUsualRows, weight.outputs, Type::f32))
      .weights_desc();
}

/// What depends on sizes alone, kept: it is made by writing machine code.
struct Made {
  dnnl::memory::desc weight, in, bias, out, scratch;
  dnnl::matmul product;
};

std::shared_ptr<const Made> make(const StippleNnWeight& weight, uint64_t rows, bool has_bias,
                                 const dnnl::memory::desc& packed) {
  auto made = std::make_shared<Made>();
  made->weight = packed;
  made->in = matrix(rows, weight.inputs, typeOf(weight.precision));
  made->bias = matrix(1, weight.outputs, Type::f32);
  made->out = matrix(rows, weight.outputs, Type::f32);
  const dnnl::matmul::primitive_desc description =
      describe(made->in, packed, has_bias ? &made->bias : nullptr, made->out);
  made->scratch = description.scratchpad_desc();
  made->product = dnnl::matmul(description);
  return made;
}

/// At most that many; sizes of networks are few, and one that is thrown away is made again.
constexpr size_t kMostMade = 512;

template <class Key, class Value>
class Kept {
 public:
  /// The value of the key, or make()'s, which two threads may make at the same time.
  template <class Make>
  Value of(const Key& key, const Make& make) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const auto found = values_.find(key);
      if (found != values_.end()) return found->second;
    }
    Value value = make();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (values_.size() >= kMostMade) values_.clear();
    values_.insert_or_assign(key, value);
    return value;
  }

 private:
  std::mutex mutex_;
  std::map<Key, Value> values_;
};

using WeightKey = std::array<uint64_t, 3>;
using ProductKey = std::array<uint64_t, 5>;

WeightKey keyOf(const StippleNnWeight& weight) {
  return {weight.inputs, weight.outputs, weight.precision};
}

// Both live as long as the process: a thread may multiply when static objects are destroyed.
dnnl::memory::desc keptForm(const StippleNnWeight& weight) {
  static auto& kept = *new Kept<WeightKey, dnnl::memory::desc>;
  return kept.of(keyOf(weight), [&] { return packedForm(weight); });
}

std::shared_ptr<const Made> keptProduct(const StippleNnWeight& weight,
                                        const StippleNnProduct& product) {
  static auto& kept = *new Kept<ProductKey, std::shared_ptr<const Made>>;
  const bool has_bias = product.bias != nullptr;
  const ProductKey key = {weight.inputs, weight.outputs, weight.precision, product.rows, has_bias};
  return kept.of(key, [&] { return make(weight, product.rows, has_bias, keptForm(weight)); });
}

void report(StippleNnStatus* status, int32_t code, const char* reason) {
  status->code = code;
  const std::string message = std::string("oneDNN cannot multiply matrices: ") + reason;
  const size_t length = std::min(message.size(), sizeof(status->message) - 1);
  std::memcpy(status->message, message.data(), length);
  status->message[length] = '\0';
}

/// Runs `work` on this thread alone; nothing is thrown across the table.
template <typename Work>
void guard(StippleNnStatus* status, const Work& work) {
  status->code = 0;
  status->message[0] = '\0';
  try {
    const OneThread held;
    work();
  } catch (const dnnl::error& error) {
    report(status, error.status == dnnl_out_of_memory ? kOutOfMemoryCode : kInternalCode,
           error.what());
  } catch (const std::bad_alloc&) {
    report(status, kOutOfMemoryCode, "there is not enough memory");
  } catch (const std::exception& error) {
    report(status, kInternalCode, error.what());
  } catch (...) {
    report(status, kInternalCode, "it gives no reason");
  }
}

// Descriptions of memory take addresses that may be written, whatever is done with them.
void* writable(const void* memory) {
  return const_cast<void*>(memory);
}

void pack(const StippleNnWeight& weight, const dnnl::memory::desc& lying, const void* values,
          void* packed) {
  dnnl::memory from(lying, engine(), writable(values));
  dnnl::memory to(keptForm(weight), engine(), packed);
  dnnl::reorder(from, to).execute(stream(), from, to);
  stream().wait();
}

extern "C" {

const char* stipple_nn_instruction_set(void) {
  switch (static_cast<int>(dnnl::get_effective_cpu_isa())) {
    case dnnl_cpu_isa_sse41:
      return "sse41";
    case dnnl_cpu_isa_avx:
      return "avx";
    case dnnl_cpu_isa_avx2:
      return "avx2";
    case dnnl_cpu_isa_avx512_core:
      return "avx512_core";
    case dnnl_cpu_isa_avx512_core_vnni:
      return "avx512_core_vnni";
    case dnnl_cpu_isa_avx512_core_bf16:
      return "avx512_core_bf16";
    case dnnl_cpu_isa_avx512_core_amx:
      return "avx512_core_amx";
    case dnnl_cpu_isa_avx2_vnni:
      return "avx2_vnni";
#if DNNL_VERSION_MAJOR >= 3
    case dnnl_cpu_isa_avx512_core_fp16:
      return "avx512_core_fp16";
    case dnnl_cpu_isa_avx512_core_amx_fp16:
      return "avx512_core_amx_fp16";
#endif
    default:
      return "other";
  }
}

uint32_t stipple_nn_has_precision(uint32_t precision) {
  if (precision == kNnFloat32) return 1;
  // The sets that have products of bfloat16; others would be slower than float32.
  const auto set = static_cast<unsigned>(dnnl::get_effective_cpu_isa());
  const auto needed = static_cast<unsigned>(dnnl::cpu_isa::avx512_core_bf16);
  return precision == kNnBfloat16 && (set & needed) == needed ? 1 : 0;
}

uint64_t stipple_nn_packed_bytes(const StippleNnWeight* weight, StippleNnStatus* status) {
  uint64_t bytes = 0;
  guard(status, [&] { bytes = keptForm(*weight).get_size(); });
  return bytes;
}

void stipple_nn_pack(const StippleNnWeight* weight, const void* values, void* packed,
                     StippleNnStatus* status) {
  guard(status, [&] { pack(*weight, transposed(*weight, 1, weight->inputs), values, packed); });
}

void stipple_nn_pack_turned(const StippleNnWeight* weight, const void* values, uint64_t stride,
                            void* packed, StippleNnStatus* status) {
  guard(status, [&] { pack(*weight, transposed(*weight, stride, 1), values, packed); });
}

void stipple_nn_multiply(const StippleNnWeight* weight, const StippleNnProduct* product,
                         const void* packed, StippleNnStatus* status) {
  guard(status, [&] {
    const std::shared_ptr<const Made> made = keptProduct(*weight, *product);
    static thread_local ThreadMemory out_memory, scratch_memory;
    const bool has_gaps = product->out_stride != weight->outputs;
    float* to =
        has_gaps ? static_cast<float*>(out_memory.atLeast(made->out.get_size())) : product->out;
    std::unordered_map<int, dnnl::memory> arguments = {
        {DNNL_ARG_SRC, dnnl::memory(made->in, engine(), writable(product->in))},
        {DNNL_ARG_WEIGHTS, dnnl::memory(made->weight, engine(), writable(packed))},
        {DNNL_ARG_DST, dnnl::memory(made->out, engine(), to)},
        {DNNL_ARG_SCRATCHPAD,
         dnnl::memory(made->scratch, engine(),
                      scratch_memory.atLeast(std::max<size_t>(made->scratch.get_size(), 1)))}};
    if (product->bias != nullptr) {
      arguments.emplace(DNNL_ARG_BIAS, dnnl::memory(made->bias, engine(), writable(product->bias)));
    }
    made->product.execute(stream(), arguments);
    stream().wait();
    if (!has_gaps) return;
    for (uint64_t row = 0; row < product->rows; ++row) {
      std::memcpy(product->out + row * product->out_stride, to + row * weight->outputs,
                  weight->outputs * sizeof(float));
    }
  });
}

}  // extern "C"

}  // namespace

extern "C" const StippleNnTable* stipple_nn_table(uint32_t version) {
  static const StippleNnTable kTable = {kNnTableVersion,          stipple_nn_instruction_set,
                                        stipple_nn_has_precision, stipple_nn_packed_bytes,
                                        stipple_nn_pack,          stipple_nn_pack_turned,
                                        stipple_nn_multiply};
  return version == kNnTableVersion ? &kTable : nullptr;
}

}  // namespace stipple::onednn
