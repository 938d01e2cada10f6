// Based on: the compressed PLY of PlayCanvas (developer.playcanvas.com, Compressed PLY format).
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/compression.h"
#include "io/input_file.h"
#include "io/little_endian.h"
#include "io/ply_comments.h"
#include "io/ply_compressed.h"
#include "io/ply_file.h"
#include "io/ply_header.h"
#include "io/ply_rows.h"

namespace stipple {

namespace {

/// Where the rows of an element lie, and where in a row its properties do.
struct Rows {
  const PlyElement* element = nullptr;
  uint64_t offset = 0;
  size_t stride = 0;
};

/// 0..1 in even steps.
template <size_t kCount>
std::array<double, kCount> sharesOf() {
  std::array<double, kCount> shares;
  for (size_t i = 0; i < kCount; ++i) {
    shares[i] = static_cast<double>(i) / static_cast<double>(kCount - 1);
  }
  return shares;
}

class Reader {
 public:
  Reader(const std::string& path, Progress* progress)
      : file_(path), progress_(progress), header_(readPlyHeader(file_)) {
    for (size_t byte = 0; byte < 256; ++byte) {
      harmonic_of_[byte] = static_cast<float>(plyHarmonicOf(static_cast<uint8_t>(byte)));
    }
  }

  SplatCloud read() {
    if (header_.encoding != PlyEncoding::kLittleEndian) {
      fail(ErrorCode::kUnsupported,
           file_.path() +
               " is a compressed PLY that is not binary_little_endian; only that is known");
    }
    findElements();
    readPlyComments(header_.comments, file_.path(), cloud_);
    readChunks();
    cloud_.resize(static_cast<size_t>(vertices_.element->count));
    std::array<size_t, 4> columns;
    for (size_t k = 0; k < 4; ++k) {
      columns[k] = column(vertices_, kPackedProperties[k], PlyType::kUint32);
    }
    const std::vector<size_t> harmonics = harmonicColumns();
    std::atomic<size_t> done{0};
    parallelFor(cloud_.size(), kPlyChunkSplats * 16, [&](size_t begin, size_t end) {
      decodeRows(columns, begin, end);
      if (!harmonics.empty()) decodeHarmonics(harmonics, begin, end);
      const size_t rows = done.fetch_add(end - begin) + (end - begin);
      advance(progress_, static_cast<double>(rows) / static_cast<double>(cloud_.size()),
              "Reading splats");
    });
    return std::move(cloud_);
  }

 private:
  [[noreturn]] void failHere(const std::string& what) const {
    fail(ErrorCode::kFormat, file_.path() + " is not a valid compressed PLY file: " + what);
  }

  void findElements() {
    PlyRowReader rows(file_, header_);
    for (const PlyElement& element : header_.elements) {
      const Rows here = {&element, rows.offset(), rows.layout(element).stride};
      if (element.name == "chunk") chunks_ = here;
      if (element.name == "vertex") vertices_ = here;
      if (element.name == "sh") harmonics_ = here;
      if (element.hasList() &&
          (element.name == "chunk" || element.name == "vertex" || element.name == "sh")) {
        failHere("its element '" + element.name + "' has a list; numbers are expected");
      }
      rows.skip(element);
    }
    if (chunks_.element == nullptr || vertices_.element == nullptr) {
      failHere("it has no element 'vertex' beside 'chunk'; both are expected");
    }
    const uint64_t count = vertices_.element->count;
    const uint64_t needed = (count + kPlyChunkSplats - 1) / kPlyChunkSplats;
    if (chunks_.element->count < needed) {
      failHere("its " + std::to_string(count) + " splats take " + std::to_string(needed) +
               " chunks; it has " + std::to_string(chunks_.element->count));
    }
    if (harmonics_.element == nullptr) return;
    if (harmonics_.element->count != count) {
      failHere("it has " + std::to_string(count) + " splats and harmonics for " +
               std::to_string(harmonics_.element->count) + "; the two must be equal");
    }
    const size_t numbers = harmonics_.element->properties.size();
    for (int degree = 0; degree <= 3; ++degree) {
      if (numbers == (shCoefficientCount(degree) - 1) * 3) cloud_.sh_degree = degree;
    }
    if (numbers != cloud_.shStride() - 3) {
      failHere("its element 'sh' has " + std::to_string(numbers) +
               " properties; 0, 9, 24 or 45 make whole bands");
    }
  }

  /// Place of a property in its row.
  size_t column(const Rows& rows, const std::string& name, PlyType type) const {
    size_t offset = 0;
    for (const PlyProperty& property : rows.element->properties) {
      if (property.name == name && property.type == type) return offset;
      offset += plyTypeSize(property.type);
    }
    failHere("its element '" + rows.element->name + "' has no property '" + name + "' of type " +
             (type == PlyType::kFloat32  ? "float"
              : type == PlyType::kUint32 ? "uint"
                                         : "uchar"));
  }

  void readChunks() {
    const size_t count = static_cast<size_t>(chunks_.element->count);
    std::array<size_t, kPlyChunkNumbers> columns{};
    // Without ranges, colours lie in 0..1, as the first version of the format had it.
    bool has_colours = false;
    for (const PlyProperty& property : chunks_.element->properties) {
      has_colours = has_colours || property.name == "min_r";
    }
    const size_t numbers = has_colours ? kPlyChunkNumbers : kPlyChunkNumbers - 6;
    for (size_t k = 0; k < numbers; ++k) {
      columns[k] = column(chunks_, kChunkProperties[k], PlyType::kFloat32);
    }
    ByteVector rows(count * chunks_.stride);
    file_.readAt(chunks_.offset, rows.data(), rows.size());
    ranges_.resize(count);
    for (size_t i = 0; i < count; ++i) {
      for (size_t k = 0; k < kPlyChunkNumbers; ++k) {
        ranges_[i][k] = k < numbers ? loadFloat(&rows[i * chunks_.stride + columns[k]])
                                    : (k < kPlyChunkNumbers - 3 ? 0.0f : 1.0f);
        const bool is_scale = k >= 6 && k < 12;
        if (std::isfinite(ranges_[i][k]) && !(is_scale && ranges_[i][k] > kPlyLargestLogScale)) {
          continue;
        }
        failHere(std::string(kChunkProperties[k]) + " of chunk " + std::to_string(i) + " is " +
                 std::to_string(ranges_[i][k]) +
                 "; a finite number, and a logarithm up "
                 "to 88.7 for scales, is expected");
      }
    }
  }

  /// Rows [begin, end) of an element.
  ByteVector bytesOf(const Rows& rows, size_t begin, size_t end) const {
    ByteVector block((end - begin) * rows.stride);
    file_.readAt(rows.offset + begin * uint64_t{rows.stride}, block.data(), block.size());
    return block;
  }

  void decodeRows(const std::array<size_t, 4>& columns, size_t begin, size_t end) {
    const ByteVector block = bytesOf(vertices_, begin, end);
    for (size_t i = begin; i < end; ++i) {
      const uint8_t* row = &block[(i - begin) * vertices_.stride];
      std::array<uint32_t, 4> packed;
      for (size_t k = 0; k < 4; ++k) packed[k] = loadLittleEndian<uint32_t>(row + columns[k]);
      decode(packed, i);
    }
  }

  /// The three numbers of 11, 10 and 11 bits, between the ranges that start at `first`.
  std::array<double, 3> unpack(uint32_t packed, const PlyChunkRange& range, size_t first) const {
    const std::array<double, 3> shares = {shares_of_11_[packed >> 21],
                                          shares_of_10_[packed >> 11 & 1023],
                                          shares_of_11_[packed & 2047]};
    std::array<double, 3> values;
    for (size_t k = 0; k < 3; ++k) values[k] = between(range, first + k, shares[k]);
    return values;
  }

  static double between(const PlyChunkRange& range, size_t lowest, double share) {
    const double low = static_cast<double>(range[lowest]);
    return low + (static_cast<double>(range[lowest + 3]) - low) * share;
  }

  void decode(const std::array<uint32_t, 4>& packed, size_t i) {
    const PlyChunkRange& range = ranges_[i / kPlyChunkSplats];
    const std::array<double, 3> position = unpack(packed[0], range, 0);
    const std::array<double, 3> logarithm = unpack(packed[2], range, 6);
    float* sh = &cloud_.sh[i * cloud_.shStride()];
    for (size_t k = 0; k < 3; ++k) {
      cloud_.positions[i * 3 + k] = static_cast<float>(position[k]);
      cloud_.scales[i * 3 + k] = static_cast<float>(std::exp(logarithm[k]));
      const double colour = between(range, 12 + k, shares_of_8_[packed[3] >> (24 - 8 * k) & 255]);
      sh[k] = static_cast<float>((colour - 0.5) / kPlyChunkC0);
    }
    cloud_.opacities[i] = static_cast<float>(shares_of_8_[packed[3] & 255]);
    decodeRotation(packed[1], &cloud_.rotations[i * 4]);
  }

  /// Index of the largest of w, x, y, z in 2 bits, then the others in 10 bits each, between
  /// -sqrt(1/2) and sqrt(1/2).
  void decodeRotation(uint32_t packed, float* q) const {
    const size_t largest = packed >> 30;
    double squares = 0;
    for (size_t k = 4; k-- > 0;) {
      if (k == largest) continue;
      const double value = (shares_of_10_[packed & 1023] - 0.5) * std::sqrt(2.0);
      packed >>= 10;
      squares += value * value;
      q[k] = static_cast<float>(value);
    }
    q[largest] = static_cast<float>(std::sqrt(std::max(0.0, 1.0 - squares)));
    if (squares <= 1.0) return;
    for (size_t k = 0; k < 4; ++k) {
      q[k] = static_cast<float>(static_cast<double>(q[k]) / std::sqrt(squares));
    }
  }

  /// Where in a row the harmonics lie: all of red, then all of green, then all of blue.
  std::vector<size_t> harmonicColumns() const {
    std::vector<size_t> columns;
    for (size_t k = 0; k < cloud_.shStride() - 3; ++k) {
      columns.push_back(column(harmonics_, "f_rest_" + std::to_string(k), PlyType::kUint8));
    }
    return columns;
  }

  void decodeHarmonics(const std::vector<size_t>& columns, size_t begin, size_t end) {
    const ByteVector block = bytesOf(harmonics_, begin, end);
    const size_t stride = cloud_.shStride();
    const size_t rest = columns.size() / 3;
    // In the order of the cloud, so that it is written from front to back.
    std::array<size_t, 45> from;
    for (size_t k = 0; k < columns.size(); ++k) from[k] = columns[k % 3 * rest + k / 3];
    for (size_t i = begin; i < end; ++i) {
      const uint8_t* row = &block[(i - begin) * harmonics_.stride];
      float* sh = &cloud_.sh[i * stride + 3];
      for (size_t k = 0; k < columns.size(); ++k) sh[k] = harmonic_of_[row[from[k]]];
    }
  }

  InputFile file_;
  Progress* progress_;
  PlyHeader header_;
  Rows chunks_, vertices_, harmonics_;
  std::vector<PlyChunkRange> ranges_;
  SplatCloud cloud_;
  // Divisions take longer than these look-ups.
  const std::array<double, 2048> shares_of_11_ = sharesOf<2048>();
  const std::array<double, 1024> shares_of_10_ = sharesOf<1024>();
  const std::array<double, 256> shares_of_8_ = sharesOf<256>();
  std::array<float, 256> harmonic_of_;
};

}  // namespace

bool startsAsCompressedPly(const SplatFileStart& start) {
  const size_t chunk = start.bytes.find("\nelement chunk ");
  return start.bytes.rfind("ply", 0) == 0 && chunk != std::string::npos &&
         chunk < start.bytes.find("\nend_header");
}

bool startsAsPly(const SplatFileStart& start) {
  return start.bytes.rfind("ply", 0) == 0 && !startsAsCompressedPly(start);
}

SplatCloud readCompressedPly(const std::string& path, Progress* progress) {
  return Reader(path, progress).read();
}

}  // namespace stipple
