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
#include "io/bytes/compression.h"
#include "io/bytes/input_file.h"
#include "io/bytes/little_endian.h"
#include "io/splats/ply/ply_comments.h"
#include "io/splats/ply/ply_compressed.h"
#include "io/splats/ply/ply_compressed_kernel.h"
#include "io/splats/ply/ply_file.h"
#include "io/splats/ply/ply_header.h"
#include "io/splats/ply/ply_rows.h"

namespace stipple {

namespace {

/// Where the rows of an element lie, and where in a row its properties do.
struct Rows {
  const PlyElement* element = nullptr;
  uint64_t offset = 0;
  size_t stride = 0;
};

// Chunks of one task: 250 KB of the file at degree 3.
constexpr size_t kTaskChunks = 16;
// A colour's harmonic of band 0 is 3.5 times as large and has to be a float32, too.
constexpr float kLargestColour = 9.599e37f;

/// exp(low + (high - low) * steps / last) for whole steps: the exponential of a sum is a product,
/// and a chunk has fewer factors than splats.
class ScaleTable {
 public:
  ScaleTable(float low, float high, uint32_t last) : low_(static_cast<double>(low)) {
    step_ = (static_cast<double>(high) - low_) / last;
    most_ = std::max(low_, static_cast<double>(high));
    // Beyond these, factors of a product that has a value may have none.
    is_tame_ = std::abs(low_) < kMost && std::abs(static_cast<double>(high)) < kMost;
    if (!is_tame_) return;
    // Each is the one before times the same: relative errors grow to 64 roundings of a double.
    fillPowers(1.0, std::exp(step_), fine_);
    fillPowers(std::exp(low_), std::exp(step_ * kFine), coarse_);
  }

  float operator()(uint32_t steps) const {
    // Not beyond the ends, which rounding of wide ranges leaves otherwise.
    if (!is_tame_) return static_cast<float>(std::exp(std::min(low_ + steps * step_, most_)));
    return static_cast<float>(coarse_[steps / kFine] * fine_[steps % kFine]);
  }

 private:
  static constexpr size_t kFine = 32;
  static constexpr double kMost = 300.0;

  template <size_t kCount>
  static void fillPowers(double first, double factor, std::array<double, kCount>& powers) {
    for (double& power : powers) {
      power = first;
      first *= factor;
    }
  }

  double low_, step_, most_;
  bool is_tame_;
  std::array<double, kFine> fine_;
  std::array<double, 2048 / kFine> coarse_;
};

class Reader {
 public:
  Reader(const std::string& path, Progress* progress)
      : file_(path),
        progress_(progress),
        header_(readPlyHeader(file_)),
        kernel_(plyChunkKernel()) {}

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
    const PlyHarmonicRows harmonics = harmonicRows();
    std::atomic<size_t> done{0};
    parallelFor(cloud_.size(), kPlyChunkSplats * kTaskChunks, [&](size_t begin, size_t end) {
      // Of each row, band 0 lies in front of the rest and is written behind it.
      if (harmonics.row_bytes > 0) decodeHarmonics(harmonics, begin, end);
      decodeRows(columns, begin, end);
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
        const bool is_colour = k >= 12;
        if (std::isfinite(ranges_[i][k]) && !(is_scale && ranges_[i][k] > kPlyLargestLogScale) &&
            !(is_colour && std::abs(ranges_[i][k]) > kLargestColour)) {
          continue;
        }
        failHere(std::string(kChunkProperties[k]) + " of chunk " + std::to_string(i) + " is " +
                 std::to_string(ranges_[i][k]) +
                 "; a finite number, for scales a logarithm up to 88.7, for colours one of size "
                 "9.599e37 "
                 "at most, is expected");
      }
    }
  }

  /// Rows [begin, end) of an element, and room behind them.
  ByteVector bytesOf(const Rows& rows, size_t begin, size_t end, size_t room) const {
    const size_t bytes = (end - begin) * rows.stride;
    ByteVector block(bytes + room);
    file_.readAt(rows.offset + begin * uint64_t{rows.stride}, block.data(), bytes);
    return block;
  }

  void decodeRows(const std::array<size_t, 4>& columns, size_t begin, size_t end) {
    const ByteVector block = bytesOf(vertices_, begin, end, 0);
    PlyChunkBits bits{};
    for (size_t from = begin; from < end; from += kPlyChunkSplats) {
      const size_t count = std::min(kPlyChunkSplats, end - from);
      for (size_t i = 0; i < count; ++i) {
        const uint8_t* row = &block[(from - begin + i) * vertices_.stride];
        for (size_t k = 0; k < 4; ++k) bits[k][i] = loadLittleEndian<uint32_t>(row + columns[k]);
      }
      decodeChunk(bits, from, count);
    }
  }

  void decodeChunk(const PlyChunkBits& bits, size_t from, size_t count) {
    const PlyChunkRange& range = ranges_[from / kPlyChunkSplats];
    std::array<std::array<float, kPlyChunkSplats>, 3> colours;
    if (count == kPlyChunkSplats) {
      kernel_.decode(bits, range,
                     {&cloud_.positions[from * 3], &cloud_.rotations[from * 4],
                      &cloud_.opacities[from], &colours});
    } else {
      std::array<float, kPlyChunkSplats * 3> positions;
      std::array<float, kPlyChunkSplats * 4> rotations;
      std::array<float, kPlyChunkSplats> opacities;
      kernel_.decode(bits, range, {positions.data(), rotations.data(), opacities.data(), &colours});
      std::copy_n(positions.data(), count * 3, &cloud_.positions[from * 3]);
      std::copy_n(rotations.data(), count * 4, &cloud_.rotations[from * 4]);
      std::copy_n(opacities.data(), count, &cloud_.opacities[from]);
    }
    const ScaleTable x(range[6], range[9], 2047);
    const ScaleTable y(range[7], range[10], 1023);
    const ScaleTable z(range[8], range[11], 2047);
    const size_t stride = cloud_.shStride();
    for (size_t i = 0; i < count; ++i) {
      const uint32_t packed = bits[2][i];
      float* scale = &cloud_.scales[(from + i) * 3];
      scale[0] = x(packed >> 21);
      scale[1] = y(packed >> 11 & 1023);
      scale[2] = z(packed & 2047);
      float* sh = &cloud_.sh[(from + i) * stride];
      for (size_t k = 0; k < 3; ++k) sh[k] = colours[k][i];
    }
  }

  /// Where in a row the harmonics lie: all of red, then all of green, then all of blue.
  PlyHarmonicRows harmonicRows() const {
    PlyHarmonicRows rows{};
    rows.row_bytes = cloud_.shStride() - 3;
    const size_t rest = rows.row_bytes / 3;
    for (size_t k = 0; k < rows.row_bytes; ++k) {
      const std::string name = "f_rest_" + std::to_string(k % 3 * rest + k / 3);
      rows.from[k] = static_cast<uint8_t>(column(harmonics_, name, PlyType::kUint8));
    }
    return rows;
  }

  void decodeHarmonics(PlyHarmonicRows rows, size_t begin, size_t end) {
    const ByteVector block = bytesOf(harmonics_, begin, end, PlyHarmonicRows::kReadable);
    rows.bytes = block.data();
    rows.count = end - begin;
    kernel_.decodeHarmonics(rows, &cloud_.sh[begin * cloud_.shStride()]);
  }

  InputFile file_;
  Progress* progress_;
  PlyHeader header_;
  Rows chunks_, vertices_, harmonics_;
  std::vector<PlyChunkRange> ranges_;
  SplatCloud cloud_;
  const PlyChunkKernel& kernel_;
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
