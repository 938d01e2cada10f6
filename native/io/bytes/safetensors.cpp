// Based on: the safetensors format, version 0.3 (Hugging Face): u64 header length, JSON header,
// tensors one after another.
#include "io/bytes/safetensors.h"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "base/error.h"
#include "io/bytes/checksum.h"
#include "io/bytes/json_text.h"
#include "io/bytes/output_file.h"

namespace stipple {

namespace {

using Json = nlohmann::json;

// The format's own limit.
constexpr uint64_t kMaxHeaderBytes = 100000000;
// A header of a multiple of 8 bytes keeps 8-byte numbers aligned in a memory map.
constexpr size_t kAlignment = 8;
constexpr char kMetadataKey[] = "__metadata__";
constexpr char kChecksumKey[] = "checksum";
constexpr size_t kChecksumDigits = 16;
constexpr size_t kChecksumPiece = size_t{1} << 20;

static_assert(std::endian::native == std::endian::little,
              "tensors are little-endian and copied as they stand");

std::optional<uint64_t> dtypeBytes(const std::string& dtype) {
  static const std::pair<const char*, uint64_t> kTypes[] = {
      {"F64", 8}, {"I64", 8}, {"U64", 8},  {"F32", 4},     {"I32", 4},
      {"U32", 4}, {"F16", 2}, {"BF16", 2}, {"I16", 2},     {"U16", 2},
      {"I8", 1},  {"U8", 1},  {"BOOL", 1}, {"F8_E4M3", 1}, {"F8_E5M2", 1}};
  for (const auto& [name, bytes] : kTypes) {
    if (dtype == name) return bytes;
  }
  return std::nullopt;
}

/// Product of sizes, or nothing where it does not fit.
std::optional<uint64_t> product(const std::vector<uint64_t>& shape, uint64_t factor) {
  uint64_t result = factor;
  for (const uint64_t size : shape) {
    if (size != 0 && result > std::numeric_limits<uint64_t>::max() / size) return std::nullopt;
    result *= size;
  }
  return result;
}

std::string shapeText(const std::vector<uint64_t>& shape) {
  std::string text = "[";
  for (const uint64_t size : shape) text += (text.size() > 1 ? ", " : "") + std::to_string(size);
  return text + "]";
}

template <typename T>
const char* dtypeName() {
  if constexpr (std::is_same_v<T, float>) return "F32";
  if constexpr (std::is_same_v<T, double>) return "F64";
  if constexpr (std::is_same_v<T, uint8_t>) return "U8";
  if constexpr (std::is_same_v<T, uint32_t>) return "U32";
  if constexpr (std::is_same_v<T, uint64_t>) return "U64";
}

/// Where the digits of the checksum stand in a header, whose keys and texts have no quotes that are
/// not escaped; npos where there are none.
size_t checksumPlace(const std::string& header) {
  const std::string key = std::string("\"") + kChecksumKey + "\":\"";
  const size_t place = header.find(key);
  if (place == std::string::npos || place + key.size() + kChecksumDigits > header.size()) {
    return std::string::npos;
  }
  return place + key.size();
}

std::string hexadecimal(uint64_t value) {
  char text[kChecksumDigits + 1];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(value));
  return text;
}

SafeTensor parseTensor(const std::string& path, const std::string& name, const Json& entry,
                       uint64_t data_start, uint64_t data_bytes) {
  const std::string what = path + ": tensor '" + name.substr(0, 80) + "' ";
  const auto whole = [](const Json& list) {
    if (!list.is_array()) return false;
    for (const Json& value : list) {
      if (!value.is_number_unsigned()) return false;
    }
    return true;
  };
  if (!entry.is_object() || !entry.contains("dtype") || !entry["dtype"].is_string() ||
      !entry.contains("shape") || !whole(entry["shape"]) || !entry.contains("data_offsets") ||
      !whole(entry["data_offsets"]) || entry["data_offsets"].size() != 2) {
    fail(ErrorCode::kFormat, what + "needs a dtype, a shape and two data_offsets");
  }
  SafeTensor tensor;
  tensor.dtype = entry["dtype"].get<std::string>();
  tensor.shape = entry["shape"].get<std::vector<uint64_t>>();
  const uint64_t begin = entry["data_offsets"][0].get<uint64_t>();
  const uint64_t end = entry["data_offsets"][1].get<uint64_t>();
  if (begin > end || end > data_bytes) {
    fail(ErrorCode::kFormat, what + "claims the bytes " + std::to_string(begin) + " to " +
                                 std::to_string(end) + "; the file holds " +
                                 std::to_string(data_bytes) + " bytes of data");
  }
  tensor.offset = data_start + begin;
  tensor.bytes = end - begin;
  const std::optional<uint64_t> value_bytes = dtypeBytes(tensor.dtype);
  // A type from a newer version of the format may still be passed over.
  if (value_bytes && product(tensor.shape, *value_bytes) != tensor.bytes) {
    fail(ErrorCode::kFormat, what + "has " + std::to_string(tensor.bytes) +
                                 " bytes for the shape " + shapeText(tensor.shape) + " of " +
                                 tensor.dtype);
  }
  return tensor;
}

/// Refuses tensors that share bytes: each is read into an array of its own, so that the size of the
/// file would not bound what they take.
void requireSeparate(const std::map<std::string, SafeTensor>& tensors, const std::string& path) {
  std::vector<const SafeTensor*> in_order;
  for (const auto& [name, tensor] : tensors) {
    if (tensor.bytes > 0) in_order.push_back(&tensor);
  }
  std::sort(in_order.begin(), in_order.end(),
            [](const SafeTensor* a, const SafeTensor* b) { return a->offset < b->offset; });
  for (size_t i = 1; i < in_order.size(); ++i) {
    if (in_order[i]->offset < in_order[i - 1]->offset + in_order[i - 1]->bytes) {
      fail(ErrorCode::kFormat, path + " has two tensors that share the bytes from " +
                                   std::to_string(in_order[i]->offset) +
                                   "; each tensor has bytes of its own");
    }
  }
}

}  // namespace

SafeTensorsReader::SafeTensorsReader(const std::string& path) : file_(path) {
  if (file_.size() < 8) {
    fail(ErrorCode::kFormat, path + " holds " + std::to_string(file_.size()) +
                                 " bytes; a safetensors file has at least 8");
  }
  uint64_t header_bytes = 0;
  file_.readAt(0, &header_bytes, sizeof(header_bytes));
  if (header_bytes > file_.size() - 8 || header_bytes > kMaxHeaderBytes) {
    fail(ErrorCode::kFormat, path + " claims a header of " + std::to_string(header_bytes) +
                                 " bytes, but holds " + std::to_string(file_.size()) +
                                 "; it is not a safetensors file or is truncated");
  }
  std::string text(static_cast<size_t>(header_bytes), '\0');
  file_.readAt(8, text.data(), text.size());
  const Json header = parseJson(text, path + ": its header");
  if (!header.is_object()) fail(ErrorCode::kFormat, path + " has a header that is no JSON object");
  const uint64_t data_start = 8 + header_bytes;
  for (const auto& [name, entry] : header.items()) {
    if (name != kMetadataKey) {
      tensors_[name] = parseTensor(path, name, entry, data_start, file_.size() - data_start);
      continue;
    }
    if (!entry.is_object()) fail(ErrorCode::kFormat, path + " has metadata that is no JSON object");
    for (const auto& [key, value] : entry.items()) {
      if (!value.is_string()) {
        fail(ErrorCode::kFormat, path + " has metadata '" + key + "' that is not a text");
      }
      metadata_[key] = value.get<std::string>();
    }
  }
  requireSeparate(tensors_, path);
}

const SafeTensor& SafeTensorsReader::require(const std::string& name, const char* dtype,
                                             uint64_t width) const {
  const auto found = tensors_.find(name);
  if (found == tensors_.end()) {
    fail(ErrorCode::kFormat, path() + " has no tensor '" + name + "'");
  }
  const SafeTensor& tensor = found->second;
  std::vector<uint64_t> tail(tensor.shape.begin() + (tensor.shape.empty() ? 0 : 1),
                             tensor.shape.end());
  if (tensor.dtype != dtype || tensor.shape.empty() || product(tail, 1) != width) {
    fail(ErrorCode::kFormat, path() + ": tensor '" + name + "' is " + tensor.dtype + " " +
                                 shapeText(tensor.shape) + "; " + dtype + " [n" +
                                 (width > 1 ? ", " + std::to_string(width) : "") + "] is needed");
  }
  read_.insert(name);
  return tensor;
}

template <typename T>
std::vector<T> SafeTensorsReader::readValues(const SafeTensor& tensor) const {
  std::vector<T> values(static_cast<size_t>(tensor.bytes / sizeof(T)));
  file_.readAt(tensor.offset, values.data(), values.size() * sizeof(T));
  return values;
}

std::vector<float> SafeTensorsReader::readFloats(const std::string& name, uint64_t width) const {
  return readValues<float>(require(name, "F32", width));
}

std::vector<uint32_t> SafeTensorsReader::readUint32s(const std::string& name,
                                                     uint64_t width) const {
  return readValues<uint32_t>(require(name, "U32", width));
}

std::vector<uint64_t> SafeTensorsReader::readUint64s(const std::string& name,
                                                     uint64_t width) const {
  return readValues<uint64_t>(require(name, "U64", width));
}

Tensor SafeTensorsReader::readTensor(const std::string& name) const {
  const auto found = tensors_.find(name);
  if (found == tensors_.end()) {
    fail(ErrorCode::kFormat, path() + " has no tensor '" + name + "'");
  }
  Tensor tensor;
  tensor.shape = found->second.shape;
  const auto read = [&]<typename T>(std::vector<T>) {
    if (found->second.dtype != dtypeName<T>()) return false;
    tensor.values = readValues<T>(found->second);
    return true;
  };
  if (!read(std::vector<float>()) && !read(std::vector<double>()) &&
      !read(std::vector<uint8_t>()) && !read(std::vector<uint32_t>()) &&
      !read(std::vector<uint64_t>())) {
    fail(ErrorCode::kFormat, path() + ": tensor '" + name + "' is of the type " +
                                 found->second.dtype.substr(0, 20) +
                                 "; F32, F64, U8, U32 or U64 is needed");
  }
  read_.insert(name);
  return tensor;
}

bool SafeTensorsReader::checksumIsRight(bool needs_one) const {
  const auto written = metadata_.find(kChecksumKey);
  if (written == metadata_.end()) return !needs_one;
  uint64_t header_bytes = 0;
  file_.readAt(0, &header_bytes, sizeof(header_bytes));
  std::string header(static_cast<size_t>(header_bytes), '\0');
  file_.readAt(sizeof(header_bytes), header.data(), header.size());
  const size_t place = checksumPlace(header);
  if (place == std::string::npos) return false;
  header.replace(place, kChecksumDigits, kChecksumDigits, '0');
  Checksum sum;
  sum.add(&header_bytes, sizeof(header_bytes));
  sum.add(header.data(), header.size());
  std::vector<uint8_t> piece(kChecksumPiece);
  for (uint64_t at = sizeof(header_bytes) + header_bytes; at < file_.size();) {
    const size_t count = static_cast<size_t>(std::min<uint64_t>(piece.size(), file_.size() - at));
    file_.readAt(at, piece.data(), count);
    sum.add(piece.data(), count);
    at += count;
  }
  return written->second == hexadecimal(sum.value());
}

std::map<std::string, CarriedTensor> SafeTensorsReader::readOthers(
    const std::function<bool(const std::string& name)>& is_left) const {
  std::map<std::string, CarriedTensor> others;
  for (const auto& [name, tensor] : tensors_) {
    if (read_.count(name) != 0 || (is_left && is_left(name))) continue;
    others[name] = {tensor.dtype, tensor.shape, readValues<uint8_t>(tensor)};
  }
  return others;
}

void SafeTensorsWriter::addEntry(const std::string& name, const char* dtype, uint64_t width,
                                 const void* data, size_t value_bytes, size_t count) {
  if (width == 0 || count % width != 0) {
    fail(ErrorCode::kInvalidArgument, "tensor '" + name + "' has " + std::to_string(count) +
                                          " values; a multiple of " + std::to_string(width) +
                                          " is needed");
  }
  Entry entry{dtype, {count / width}, data, count * value_bytes, {}};
  if (width > 1) entry.shape.push_back(width);
  entries_[name] = std::move(entry);
}

void SafeTensorsWriter::add(const std::string& name, const std::vector<float>& values,
                            uint64_t width) {
  addEntry(name, "F32", width, values.data(), sizeof(float), values.size());
}

void SafeTensorsWriter::add(const std::string& name, const std::vector<uint32_t>& values,
                            uint64_t width) {
  addEntry(name, "U32", width, values.data(), sizeof(uint32_t), values.size());
}

void SafeTensorsWriter::add(const std::string& name, const std::vector<uint64_t>& values,
                            uint64_t width) {
  addEntry(name, "U64", width, values.data(), sizeof(uint64_t), values.size());
}

void SafeTensorsWriter::add(const std::string& name, const Tensor& tensor) {
  std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        const std::optional<uint64_t> count = product(tensor.shape, 1);
        if (count != values.size()) {
          fail(ErrorCode::kInvalidArgument, "tensor '" + name + "' has " +
                                                std::to_string(values.size()) +
                                                " values for the shape " + shapeText(tensor.shape));
        }
        entries_[name] = {
            dtypeName<T>(), tensor.shape, values.data(), values.size() * sizeof(T), {}};
      },
      tensor.values);
}

void SafeTensorsWriter::addLater(const std::string& name, const Tensor& like,
                                 std::function<const Tensor&()> values) {
  add(name, like);
  entries_[name].data = nullptr;
  entries_[name].fetch = std::move(values);
}

const void* SafeTensorsWriter::Entry::values(const std::string& name) const {
  if (!fetch) return data;
  return std::visit(
      [&](const auto& fetched) -> const void* {
        using T = typename std::decay_t<decltype(fetched)>::value_type;
        if (dtype != dtypeName<T>() || bytes != fetched.size() * sizeof(T)) {
          fail(ErrorCode::kInvalidArgument,
               "tensor '" + name + "' has changed its size since it was added");
        }
        return fetched.data();
      },
      fetch().values);
}

void SafeTensorsWriter::carry(const std::string& name, const CarriedTensor& tensor) {
  entries_.emplace(name,
                   Entry{tensor.dtype, tensor.shape, tensor.bytes.data(), tensor.bytes.size(), {}});
}

void SafeTensorsWriter::addChecksum() {
  setMetadata(kChecksumKey, std::string(kChecksumDigits, '0'));
  has_checksum_ = true;
}

void SafeTensorsWriter::write(const std::string& path) const {
  Json header = Json::object();
  if (!metadata_.empty()) header[kMetadataKey] = metadata_;
  // Wide numbers first would keep all aligned; with headers of a multiple of 8 bytes and arrays of
  // 4-byte numbers in between, readers that map the file must copy odd U64 tensors, as ours does.
  uint64_t offset = 0;
  for (const auto& [name, entry] : entries_) {
    header[name] = {{"dtype", entry.dtype},
                    {"shape", entry.shape},
                    {"data_offsets", {offset, offset + entry.bytes}}};
    offset += entry.bytes;
  }
  std::string text;
  try {
    text = header.dump();
  } catch (const Json::exception& error) {
    fail(ErrorCode::kInvalidArgument,
         path + " cannot be written: its metadata is not UTF-8: " + error.what());
  }
  text.resize((text.size() + kAlignment - 1) / kAlignment * kAlignment, ' ');
  const uint64_t length = text.size();
  if (has_checksum_) {
    Checksum sum;
    sum.add(&length, sizeof(length));
    sum.add(text.data(), text.size());
    for (const auto& [name, entry] : entries_) sum.add(entry.values(name), entry.bytes);
    text.replace(checksumPlace(text), kChecksumDigits, hexadecimal(sum.value()));
  }
  OutputFile file(path);
  file.write(&length, sizeof(length));
  file.write(text.data(), text.size());
  for (const auto& [name, entry] : entries_) file.write(entry.values(name), entry.bytes);
  file.commit();
}

}  // namespace stipple
