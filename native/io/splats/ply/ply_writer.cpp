#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/compression.h"
#include "io/bytes/output_file.h"
#include "io/splats/ply/ply_comments.h"
#include "io/splats/ply/ply_file.h"
#include "io/splats/splat_check.h"

namespace stipple {

namespace {

// Rows per task, and rows per round of writing text: 4 MB and more at degree 3.
constexpr size_t kBlockRows = 1024;
constexpr size_t kChunkRows = kBlockRows * 16;

// nx ny nz are zero: no reader uses them, some count on their place.
constexpr size_t kNormalCount = 3;

constexpr size_t kMaxRowLength = 3 + kNormalCount + 75 + 1 + 3 + 4;  // harmonics of degree 4

size_t rowLength(const SplatCloud& cloud) {
  return 3 + kNormalCount + cloud.shStride() + 1 + 3 + 4;
}

std::string header(const SplatCloud& cloud, bool ascii) {
  std::string text = std::string("ply\nformat ") + (ascii ? "ascii" : "binary_little_endian") +
                     " 1.0\n" + plyComments(cloud) + "element vertex " +
                     std::to_string(cloud.size()) + "\n";
  const auto property = [&text](const std::string& name) {
    text += "property float " + name + "\n";
  };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) property(name);
  for (int i = 0; i < 3; ++i) property("f_dc_" + std::to_string(i));
  for (size_t i = 0; i < cloud.shStride() - 3; ++i) property("f_rest_" + std::to_string(i));
  property("opacity");
  for (int i = 0; i < 3; ++i) property("scale_" + std::to_string(i));
  for (int i = 0; i < 4; ++i) property("rot_" + std::to_string(i));
  return text + "end_header\n";
}

float logit(float opacity) {
  if (opacity <= 0.0f) return kPlyZero;
  if (opacity >= 1.0f) return kPlyOpaque;
  const double o = opacity;
  return static_cast<float>(std::log(o) - std::log1p(-o));
}

float logScale(float scale) {
  if (scale <= 0.0f) return kPlyZero;
  return std::min(static_cast<float>(std::log(static_cast<double>(scale))), kPlyLargestLogScale);
}

/// One splat in the order of the header.
void fillRow(const SplatCloud& cloud, size_t i, float* row) {
  for (size_t k = 0; k < 3; ++k) *row++ = cloud.positions[i * 3 + k];
  for (size_t k = 0; k < kNormalCount; ++k) *row++ = 0.0f;
  const float* sh = &cloud.sh[i * cloud.shStride()];
  const size_t coefficients = shCoefficientCount(cloud.sh_degree);
  for (size_t k = 0; k < 3; ++k) *row++ = sh[k];
  for (size_t channel = 0; channel < 3; ++channel) {
    for (size_t k = 1; k < coefficients; ++k) *row++ = sh[k * 3 + channel];
  }
  *row++ = logit(cloud.opacities[i]);
  for (size_t k = 0; k < 3; ++k) *row++ = logScale(cloud.scales[i * 3 + k]);
  for (size_t k = 0; k < 4; ++k) *row++ = cloud.rotations[i * 4 + k];
}

/// The shortest text that gives each float32 back exactly.
void appendText(const float* row, size_t length, std::string* text) {
  char digits[32];
  for (size_t k = 0; k < length; ++k) {
    const auto [end, error] = std::to_chars(digits, digits + sizeof(digits), row[k]);
    text->append(digits, end);
    text->push_back(k + 1 == length ? '\n' : ' ');
  }
}

void storeFloats(const float* row, size_t length, uint8_t* bytes) {
  if constexpr (std::endian::native == std::endian::little) {
    std::memcpy(bytes, row, length * sizeof(float));
    return;
  }
  for (size_t k = 0; k < length; ++k) {
    uint32_t bits = 0;
    std::memcpy(&bits, row + k, 4);
    for (unsigned b = 0; b < 4; ++b) bytes[k * 4 + b] = static_cast<uint8_t>(bits >> (8 * b));
  }
}

class RowProgress {
 public:
  RowProgress(size_t count, Progress* progress) : count_(count), progress_(progress) {}
  void add(size_t rows) {
    const size_t done = done_.fetch_add(rows) + rows;
    advance(progress_, static_cast<double>(done) / static_cast<double>(count_), "Writing splats");
  }

 private:
  size_t count_;
  Progress* progress_;
  std::atomic<size_t> done_{0};
};

/// Blocks of rows, each to its place by the thread that made it.
void writeBinary(const SplatCloud& cloud, const std::string& head, OutputFile& file,
                 Progress* progress) {
  file.writeAt(0, head.data(), head.size());
  const size_t length = rowLength(cloud);
  RowCheck check(cloud, "cloud");
  RowProgress done(cloud.size(), progress);
  parallelFor(cloud.size(), kBlockRows, [&](size_t begin, size_t end) {
    if (!check.look(begin, end)) return;
    ByteVector block((end - begin) * length * sizeof(float));
    std::array<float, kMaxRowLength> row;
    for (size_t i = begin; i < end; ++i) {
      fillRow(cloud, i, row.data());
      storeFloats(row.data(), length, &block[(i - begin) * length * sizeof(float)]);
    }
    file.writeAt(head.size() + begin * length * uint64_t{sizeof(float)}, block.data(),
                 block.size());
    done.add(end - begin);
  });
  check.require();
}

void writeText(const SplatCloud& cloud, const std::string& head, OutputFile& file,
               Progress* progress) {
  file.write(head.data(), head.size());
  validate(cloud, "cloud");
  const size_t length = rowLength(cloud);
  std::vector<std::string> blocks(kChunkRows / kBlockRows);
  RowProgress done(cloud.size(), progress);
  for (size_t chunk = 0; chunk < cloud.size(); chunk += kChunkRows) {
    const size_t rows = std::min(kChunkRows, cloud.size() - chunk);
    parallelFor(rows, kBlockRows, [&](size_t begin, size_t end) {
      std::string& block = blocks[begin / kBlockRows];
      block.clear();
      std::array<float, kMaxRowLength> row;
      for (size_t i = begin; i < end; ++i) {
        fillRow(cloud, chunk + i, row.data());
        appendText(row.data(), length, &block);
      }
    });
    for (size_t b = 0; b < rangeCount(rows, kBlockRows); ++b) {
      file.write(blocks[b].data(), blocks[b].size());
    }
    done.add(rows);
  }
}

}  // namespace

void writePlySplats(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress) {
  const bool ascii = options.ascii;
  OutputFile file(path);
  const std::string head = header(cloud, ascii);
  if (ascii) {
    writeText(cloud, head, file, progress);
  } else {
    writeBinary(cloud, head, file, progress);
  }
  file.commit();
}

double estimatePlySplats(uint64_t count, int degree, const SplatWriteOptions& options) {
  constexpr double kPlainNumbers = 14;  // of a splat of degree 0, beside the normals
  constexpr double kTextBytes = 11;     // of float32 as its shortest text and a blank, in scenes
  constexpr double kZeroBytes = 2;
  const double numbers = kPlainNumbers + higherHarmonics(degree);
  const double row = options.ascii
                         ? numbers * kTextBytes + kNormalCount * kZeroBytes
                         : (numbers + static_cast<double>(kNormalCount)) * sizeof(float);
  constexpr double kHeaderBytes = 500;
  constexpr double kPropertyBytes = 24;
  return kHeaderBytes + kPropertyBytes * higherHarmonics(degree) + static_cast<double>(count) * row;
}

}  // namespace stipple
