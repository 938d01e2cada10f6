#include "data/weight_table.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <mutex>
#include <set>
#include <utility>

#include "base/error.h"

namespace stipple {

namespace {

static_assert(std::endian::native == std::endian::little,
              "tensors are little-endian and read as they stand");

std::string shapeText(std::span<const uint64_t> shape) {
  std::string text = "[";
  for (const uint64_t size : shape) {
    text += text.size() > 1 ? ", " : "";
    text += size == kAnySize ? "any" : std::to_string(size);
  }
  return text + "]";
}

bool shapeFits(const std::vector<uint64_t>& seen, std::span<const uint64_t> asked) {
  static const std::vector<uint64_t> kOne = {1};
  const std::vector<uint64_t>& shape = seen.empty() && !asked.empty() ? kOne : seen;
  if (shape.size() != asked.size()) return false;
  for (size_t i = 0; i < shape.size(); ++i) {
    if (asked[i] != kAnySize && asked[i] != shape[i]) return false;
  }
  return true;
}

/// The value of a binary16 number, by whole numbers where it is a normal one. A subnormal one is
/// made by a subtraction of normal numbers, so that a thread that flushes small numbers to 0 keeps
/// it. Branches are choices of lanes, so that compilers make vectors of a loop around it.
float widenHalf(uint16_t half) {
  const uint32_t magnitude = static_cast<uint32_t>(half & 0x7fff) << 13;
  const uint32_t sign = static_cast<uint32_t>(half & 0x8000) << 16;
  const uint32_t exponent = magnitude & 0x0f800000u;
  const uint32_t normal = magnitude + (112u << 23);
  const uint32_t special = magnitude | 0x7f800000u;
  const float tiny = std::bit_cast<float>(magnitude + (113u << 23)) - 0x1p-14f;
  uint32_t bits = exponent == 0x0f800000u ? special : normal;
  bits = exponent == 0 ? std::bit_cast<uint32_t>(tiny) : bits;
  return std::bit_cast<float>(bits | sign);
}

/// Whether a number of the file, by its bits, is NaN or infinity.
template <typename T>
bool anyNotFinite(const uint8_t* bytes, uint64_t count, T exponent) {
  uint32_t bad = 0;
  for (uint64_t i = 0; i < count; ++i) {
    T bits;
    std::memcpy(&bits, bytes + i * sizeof(T), sizeof(T));
    bad |= static_cast<uint32_t>((bits & exponent) == exponent);
  }
  return bad != 0;
}

bool anyNotFinite(const WeightTensor& tensor, uint64_t first, uint64_t count) {
  const uint8_t* bytes = tensor.bytes + first * bytesOfNumber(tensor.type);
  switch (tensor.type) {
    case WeightType::kFloat32:
      return anyNotFinite<uint32_t>(bytes, count, 0x7f800000u);
    case WeightType::kFloat16:
      return anyNotFinite<uint16_t>(bytes, count, 0x7c00u);
    default:
      return anyNotFinite<uint16_t>(bytes, count, 0x7f80u);
  }
}

}  // namespace

uint64_t bytesOfNumber(WeightType type) {
  return type == WeightType::kFloat32 ? 4 : 2;
}

uint64_t WeightTensor::count() const {
  uint64_t result = 1;
  for (const uint64_t size : shape) result *= size;
  return result;
}

struct WeightTable::File {
  std::string source;
  std::map<std::string, WeightTensor, std::less<>> tensors;
  std::shared_ptr<const void> memory;
  mutable std::mutex mutex;
  mutable std::set<std::string, std::less<>> read;
};

WeightTable::WeightTable(std::string source, std::map<std::string, WeightTensor> tensors,
                         std::shared_ptr<const void> memory) {
  auto file = std::make_shared<File>();
  file->source = std::move(source);
  for (auto& [name, tensor] : tensors) file->tensors.emplace(name, std::move(tensor));
  file->memory = std::move(memory);
  file_ = std::move(file);
}

WeightTable WeightTable::under(std::string_view prefix) const {
  WeightTable table = *this;
  table.prefix_ += prefix;
  return table;
}

const WeightTensor* WeightTable::find(std::string_view name) const {
  if (file_ == nullptr) return nullptr;
  const auto found = file_->tensors.find(prefix_ + std::string(name));
  return found == file_->tensors.end() ? nullptr : &found->second;
}

const WeightTensor& WeightTable::require(std::string_view name,
                                         std::span<const uint64_t> shape) const {
  const std::string whole = prefix_ + std::string(name);
  const WeightTensor* tensor = find(name);
  if (tensor == nullptr) {
    fail(ErrorCode::kFormat, source() + " has no tensor '" + whole + "'; one of the shape " +
                                 shapeText(shape) + " is needed");
  }
  if (!shapeFits(tensor->shape, shape)) {
    fail(ErrorCode::kFormat, source() + ": tensor '" + whole + "' has the shape " +
                                 shapeText(tensor->shape) + "; " + shapeText(shape) + " is needed");
  }
  if (tensor->type == WeightType::kOther) {
    fail(ErrorCode::kFormat, source() + ": tensor '" + whole + "' is of the type " +
                                 tensor->type_name.substr(0, 20) + "; F32, F16 or BF16 is needed");
  }
  const std::lock_guard<std::mutex> lock(file_->mutex);
  file_->read.insert(whole);
  return *tensor;
}

std::vector<float> WeightTable::floats(std::string_view name,
                                       std::span<const uint64_t> shape) const {
  const WeightTensor& tensor = require(name, shape);
  requireFinite(name, tensor, 0, tensor.count());
  std::vector<float> values(static_cast<size_t>(tensor.count()));
  widen(tensor, 0, values);
  return values;
}

void WeightTable::requireFinite(std::string_view name, const WeightTensor& tensor, uint64_t first,
                                uint64_t count) const {
  if (!anyNotFinite(tensor, first, count)) return;
  uint64_t index = first;
  while (!anyNotFinite(tensor, index, 1)) ++index;
  float value = 0;
  widen(tensor, index, {&value, 1});
  fail(ErrorCode::kFormat, source() + ": tensor '" + prefix_ + std::string(name) +
                               "' of the shape " + shapeText(tensor.shape) + " has " +
                               (std::isnan(value) ? "NaN" : "infinity") + " as number " +
                               std::to_string(index) + "; only finite numbers are allowed");
}

std::vector<std::string> WeightTable::names() const {
  std::vector<std::string> names;
  if (file_ == nullptr) return names;
  for (auto at = file_->tensors.lower_bound(prefix_); at != file_->tensors.end(); ++at) {
    if (!at->first.starts_with(prefix_)) break;
    names.push_back(at->first.substr(prefix_.size()));
  }
  return names;
}

size_t WeightTable::countBlocks(std::string_view prefix) const {
  size_t count = 0;
  while (file_ != nullptr) {
    const std::string block = prefix_ + std::string(prefix) + std::to_string(count) + ".";
    const auto at = file_->tensors.lower_bound(block);
    if (at == file_->tensors.end() || !at->first.starts_with(block)) break;
    ++count;
  }
  return count;
}

std::vector<std::string> WeightTable::unread() const {
  std::vector<std::string> unread;
  if (file_ == nullptr) return unread;
  const std::lock_guard<std::mutex> lock(file_->mutex);
  for (const std::string& name : names()) {
    if (file_->read.count(prefix_ + name) == 0) unread.push_back(prefix_ + name);
  }
  return unread;
}

const std::string& WeightTable::source() const {
  static const std::string kNone = "a network without a file";
  return file_ == nullptr ? kNone : file_->source;
}

void widen(const WeightTensor& tensor, uint64_t first, std::span<float> out) {
  const uint8_t* bytes = tensor.bytes + first * bytesOfNumber(tensor.type);
  if (tensor.type == WeightType::kFloat32) {
    if (!out.empty()) std::memcpy(out.data(), bytes, out.size_bytes());
    return;
  }
  const auto loop = [&](auto widenOne) {
    for (size_t i = 0; i < out.size(); ++i) {
      uint16_t bits;
      std::memcpy(&bits, bytes + 2 * i, sizeof(bits));
      out[i] = widenOne(bits);
    }
  };
  if (tensor.type == WeightType::kFloat16) {
    loop([](uint16_t bits) { return widenHalf(bits); });
  } else {
    loop([](uint16_t bits) { return std::bit_cast<float>(static_cast<uint32_t>(bits) << 16); });
  }
}

}  // namespace stipple
