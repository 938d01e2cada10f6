#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace stipple {

enum class WeightType { kFloat32, kFloat16, kBfloat16, kOther };
/// Of one number. In: not kOther.
uint64_t bytesOfNumber(WeightType type);

/// One tensor of a network as it lies in its file: row-major, little-endian, at any address.
struct WeightTensor {
  WeightType type = WeightType::kOther;
  std::string type_name;        ///< as the file says it: "F16"
  std::vector<uint64_t> shape;  ///< empty for a single number
  const uint8_t* bytes = nullptr;

  uint64_t count() const;
};

/// "any size will do" in a shape that is asked for.
constexpr uint64_t kAnySize = ~uint64_t{0};

/// The named tensors of one network. The numbers stay where they are (usually a mapped file) as
/// long as any copy of the table lives; copies are cheap. Whoever uses a tensor widens a piece of
/// it at a time, so that a network never lies in memory as a whole.
class WeightTable {
 public:
  WeightTable() = default;
  /// In: source: what messages call the file; memory: keeps the bytes alive.
  WeightTable(std::string source, std::map<std::string, WeightTensor> tensors,
              std::shared_ptr<const void> memory);

  /// The tensors whose names begin with `prefix` ("blocks.0."), by the rest of their names. The
  /// whole names stay in messages.
  WeightTable under(std::string_view prefix) const;
  bool has(std::string_view name) const { return find(name) != nullptr; }
  /// Null where there is none.
  const WeightTensor* find(std::string_view name) const;
  /// In: shape, kAnySize where the network does not say. A tensor of shape [] counts as [1].
  /// Errors: kFormat, naming file, tensor, what was seen and what is allowed, for a tensor that is
  /// missing, of another shape, or of a type that is not a floating-point one of 16 or 32 bits.
  const WeightTensor& require(std::string_view name, std::span<const uint64_t> shape) const;
  const WeightTensor& require(std::string_view name, std::initializer_list<uint64_t> shape) const {
    return require(name, std::span<const uint64_t>(shape.begin(), shape.size()));
  }
  /// The numbers of a small tensor, widened. Errors: as require(); kFormat for NaN or infinity.
  std::vector<float> floats(std::string_view name, std::span<const uint64_t> shape) const;
  std::vector<float> floats(std::string_view name, std::initializer_list<uint64_t> shape) const {
    return floats(name, std::span<const uint64_t>(shape.begin(), shape.size()));
  }
  /// Refuses the numbers [first, first + count) of a tensor that require() gave where one of them
  /// is NaN or infinity. Errors: kFormat, as require().
  void requireFinite(std::string_view name, const WeightTensor& tensor, uint64_t first,
                     uint64_t count) const;
  /// Names under this table's prefix, in order.
  std::vector<std::string> names() const;
  /// How many n there are so that names begin with `prefix` + "0.", … "n-1." without a gap.
  size_t countBlocks(std::string_view prefix) const;
  /// Tensors under this prefix that no copy of the table has required or read yet, by their whole
  /// names: what a network of another kind has too many.
  std::vector<std::string> unread() const;
  const std::string& source() const;

 private:
  struct File;  // shared by all copies: source, tensors, which have been read, memory
  std::shared_ptr<const File> file_;
  std::string prefix_;
};

/// out[i] = the i-th of the tensor's numbers from `first` on, widened. In: of a type that is not
/// kOther.
void widen(const WeightTensor& tensor, uint64_t first, std::span<float> out);

}  // namespace stipple
