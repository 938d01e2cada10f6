#include "peers/full_size_files.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "peers/full_size_shapes.h"

namespace stipple {
namespace {

/// Numbers that are made and written at a time.
constexpr uint64_t kPiece = 1 << 20;

size_t bytesOf(WeightType type) {
  return type == WeightType::kFloat32 ? 4 : 2;
}

const char* nameOf(WeightType type) {
  return type == WeightType::kFloat32 ? "F32" : type == WeightType::kFloat16 ? "F16" : "BF16";
}

/// Where the numbers of a tensor lie: evenly in middle - spread .. middle + spread.
struct Range {
  float middle = 0.0f, spread = 0.05f;

  Range(const std::string& name, const std::vector<uint64_t>& shape) {
    if (name.ends_with("running_var") || name.ends_with(".gamma") ||
        (name.ends_with(".weight") && shape.size() == 1)) {
      middle = 1.0f;
      spread = 0.2f;
    } else if (name.ends_with(".weight")) {
      // Sums of products with numbers of variance 1 have variance 1.
      spread = std::sqrt(3.0f * static_cast<float>(shape[0]) / static_cast<float>(countOf(shape)));
    }
  }
};

/// The nearest float16 or the next one towards 0, of numbers below 65,504. Those below 2^-14 are 0.
uint16_t halfOf(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value);
  const uint32_t sign = bits >> 16 & 0x8000;
  const int exponent = static_cast<int>(bits >> 23 & 0xff) - 127 + 15;
  if (exponent <= 0) return static_cast<uint16_t>(sign);
  return static_cast<uint16_t>(sign | static_cast<uint32_t>(exponent) << 10 | (bits >> 13 & 0x3ff));
}

/// In: key, which no other tensor of the file has; first: of the tensor's numbers.
void makeNumbers(const Range& range, uint64_t key, uint64_t first, uint64_t count, WeightType type,
                 std::vector<uint8_t>& out) {
  const size_t size = bytesOf(type);
  out.resize(count * size);
  parallelFor(count, 1 << 14, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const uint64_t bits = keyedBits(key, RandomUse::kNetworkStart, first + i);
      const float value = range.middle + range.spread * (2.0f * unitFloat(bits) - 1.0f);
      if (type == WeightType::kFloat16) {
        const uint16_t half = halfOf(value);
        std::memcpy(out.data() + i * size, &half, size);
      } else {
        // BF16 is the upper half of F32, which comes last.
        const auto bytes = std::bit_cast<std::array<uint8_t, 4>>(value);
        std::memcpy(out.data() + i * size, bytes.data() + 4 - size, size);
      }
    }
  });
}

/// Any sign and 1/64 to 1/32, so that sums of 1024 are about as large as what goes in.
void fillHalves(uint64_t key, std::vector<uint16_t>& out) {
  constexpr uint64_t kExponent = 9 << 10, kSignAndFraction = 0x83ff;
  for (size_t i = 0; i < out.size(); ++i) {
    out[i] = static_cast<uint16_t>((mixBits(key + i) & kSignAndFraction) | kExponent);
  }
}

std::string headerOf(const WeightShapes& shapes, WeightType type) {
  std::ostringstream table;
  uint64_t size = 0;
  for (const auto& [name, shape] : shapes) {
    table << (size == 0 ? '{' : ',') << '"' << name << "\":{\"dtype\":\"" << nameOf(type)
          << "\",\"shape\":[";
    for (size_t i = 0; i < shape.size(); ++i) table << (i == 0 ? "" : ",") << shape[i];
    table << "],\"data_offsets\":[" << size;
    size += countOf(shape) * bytesOf(type);
    table << ',' << size << "]}";
  }
  table << '}';
  std::string header = table.str();
  header.resize((header.size() + 7) / 8 * 8, ' ');
  return header;
}

std::string fileIn(const std::string& folder, const char* name, const WeightShapes& shapes,
                   WeightType type) {
  namespace fs = std::filesystem;
  fs::create_directories(folder);
  const std::string path = folder + "/" + name;
  uint64_t bytes = 8 + headerOf(shapes, type).size();
  for (const auto& [tensor, shape] : shapes) bytes += countOf(shape) * bytesOf(type);
  if (!fs::exists(path) || fs::file_size(path) != bytes) writeWeights(path, shapes, type);
  return path;
}

}  // namespace

uint64_t countOf(const std::vector<uint64_t>& shape) {
  uint64_t count = 1;
  for (const uint64_t size : shape) count *= size;
  return count;
}

void writeWeights(const std::string& path, const WeightShapes& shapes, WeightType type) {
  const std::string header = headerOf(shapes, type);
  const uint64_t header_bytes = header.size();
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(&header_bytes), 8);
  file << header;
  std::vector<uint8_t> bytes;
  for (uint64_t key = 0; key < shapes.size(); ++key) {
    const auto& [name, shape] = shapes[key];
    const Range range(name, shape);
    const uint64_t count = countOf(shape);
    for (uint64_t first = 0; first < count; first += kPiece) {
      makeNumbers(range, key, first, std::min(kPiece, count - first), type, bytes);
      file.write(reinterpret_cast<const char*>(bytes.data()),
                 static_cast<std::streamsize>(bytes.size()));
    }
  }
  file.close();
  if (!file) fail(ErrorCode::kIo, path + " cannot be written.");
}

WeightTable sharedWeights(const WeightShapes& shapes) {
  constexpr uint64_t kOffsets = 4096;  // so that equal shapes are not equal numbers
  uint64_t most = 0;
  for (const auto& [name, shape] : shapes) most = std::max(most, countOf(shape));
  auto numbers = std::make_shared<std::vector<uint16_t>>(most + kOffsets);
  fillHalves(0, *numbers);
  std::map<std::string, WeightTensor> tensors;
  for (const auto& [name, shape] : shapes) {
    const size_t offset = (37 * tensors.size()) % kOffsets;
    tensors[name] = {WeightType::kFloat16, "F16", shape,
                     reinterpret_cast<const uint8_t*>(numbers->data() + offset)};
  }
  return WeightTable("made up", std::move(tensors), numbers);
}

WeightTable ownWeights(const WeightShapes& shapes) {
  auto numbers = std::make_shared<std::vector<std::vector<uint16_t>>>();
  std::map<std::string, WeightTensor> tensors;
  for (const auto& [name, shape] : shapes) {
    std::vector<uint16_t>& own = numbers->emplace_back(countOf(shape));
    fillHalves(uint64_t{numbers->size()} << 32, own);
    tensors[name] = {WeightType::kFloat16, "F16", shape,
                     reinterpret_cast<const uint8_t*>(own.data())};
  }
  return WeightTable("made up", std::move(tensors), numbers);
}

std::string structureFileIn(const std::string& folder) {
  return fileIn(folder, "dino.safetensors", dinoShapes(1280, 5120, 32), WeightType::kBfloat16);
}

std::string colourFileIn(const std::string& folder) {
  WeightShapes shapes = vaeShapes({128, 256, 512, 512}, 32);
  const WeightShapes decoder = vaeDecoderShapes();
  shapes.insert(shapes.end(), decoder.begin(), decoder.end());
  return fileIn(folder, "vae.safetensors", shapes, WeightType::kFloat32);
}

std::string flowFileIn(const std::string& folder) {
  return fileIn(folder, "flow.safetensors", flowShapes(), WeightType::kFloat16);
}

std::string decoderFileIn(const std::string& folder) {
  return fileIn(folder, "decoder.safetensors", decoderShapes(), WeightType::kFloat16);
}

}  // namespace stipple
