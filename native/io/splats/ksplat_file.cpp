// Based on: github.com/mkkellogg/GaussianSplats3D, whose SplatBuffer is this format.
#include "io/splats/ksplat_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/compression.h"
#include "io/bytes/input_file.h"
#include "io/bytes/little_endian.h"
#include "io/splats/quantize.h"
#include "io/splats/splat_check.h"
#include "math/half_float.h"

namespace stipple {

namespace {

constexpr size_t kHeaderBytes = 4096;
constexpr size_t kSectionHeaderBytes = 1024;
constexpr size_t kGrain = 8192;
constexpr size_t kCentreBytes = 12;
constexpr double kC0 = 0.28209479177387814;

/// Bytes of one number of each kind, by level of compression.
struct Layout {
  size_t position, shape, harmonic;
  uint32_t range;  ///< of position numbers, where the section does not say
};
constexpr std::array<Layout, 3> kLayouts = {{{4, 4, 4, 1}, {2, 2, 2, 32767}, {2, 2, 1, 32767}}};

struct Section {
  uint64_t header_offset = 0;
  uint64_t count = 0;
  uint64_t room = 0;  ///< splats that bytes are kept for
  uint64_t capacity = 0, buckets = 0, full = 0, partial = 0;
  uint64_t bucket_bytes = 0;
  double block_size = 0;
  uint32_t range = 0;
  int degree = 0;
  uint64_t lengths_at = 0, centres_at = 0, splats_at = 0;
  size_t row_bytes = 0;
};

class Reader {
 public:
  Reader(const std::string& path, Progress* progress) : file_(path), progress_(progress) {}

  SplatCloud read() {
    readHeader();
    readSections();
    cloud_.resize(static_cast<size_t>(count_));
    size_t first = 0;
    for (const Section& section : sections_) {
      decode(section, first);
      first += static_cast<size_t>(section.count);
      advance(progress_, static_cast<double>(first) / static_cast<double>(count_),
              "Reading splats");
    }
    requireValidSplats(cloud_, file_.path());
    return std::move(cloud_);
  }

 private:
  [[noreturn]] void failHere(const std::string& what) const {
    fail(ErrorCode::kFormat, file_.path() + " is not a valid .ksplat file: " + what);
  }

  void readHeader() {
    std::array<uint8_t, kHeaderBytes> header;
    if (file_.size() < kHeaderBytes) {
      failHere("it holds " + std::to_string(file_.size()) + " bytes; a header takes 4096");
    }
    file_.readAt(0, header.data(), header.size());
    if (header[0] != 0 || header[1] < 1) {
      failHere("its version is " + std::to_string(header[0]) + "." + std::to_string(header[1]) +
               " at byte 0; 0.1 and later 0.x can be read");
    }
    section_count_ = loadLittleEndian<uint32_t>(&header[4]);
    count_ = loadLittleEndian<uint32_t>(&header[16]);
    const uint16_t level = loadLittleEndian<uint16_t>(&header[20]);
    if (level > 2) {
      failHere("its level of compression is " + std::to_string(level) +
               " at byte 20; 0 to 2 is allowed");
    }
    layout_ = kLayouts[level];
    // Zero stands for the range that the first version of the format had.
    const float low = loadFloat(&header[36]);
    const float high = loadFloat(&header[40]);
    harmonic_low_ = low != 0.0f ? static_cast<double>(low) : -1.5;
    harmonic_high_ = high != 0.0f ? static_cast<double>(high) : 1.5;
    if (!std::isfinite(low) || !std::isfinite(high)) {
      failHere("the range of its harmonics at byte 36 is not finite");
    }
    if (section_count_ > (file_.size() - kHeaderBytes) / kSectionHeaderBytes) {
      failHere("it claims " + std::to_string(section_count_) + " sections at byte 4; its " +
               std::to_string(file_.size()) + " bytes have room for " +
               std::to_string((file_.size() - kHeaderBytes) / kSectionHeaderBytes));
    }
  }

  void readSections() {
    uint64_t data = kHeaderBytes + section_count_ * kSectionHeaderBytes;
    uint64_t total = 0;
    for (uint64_t s = 0; s < section_count_; ++s) {
      Section section = readSectionHeader(kHeaderBytes + s * kSectionHeaderBytes);
      const std::string name =
          "section " + std::to_string(s) + " (byte " + std::to_string(section.header_offset) + ")";
      section.lengths_at = data;
      section.centres_at = data + section.partial * 4;
      // All factors are 32-bit numbers or smaller: no product of two overflows.
      section.splats_at = section.centres_at + section.buckets * section.bucket_bytes;
      const uint64_t end = section.splats_at + section.room * section.row_bytes;
      if (end > file_.size()) {
        failHere(name + " needs bytes " + std::to_string(data) + " to " + std::to_string(end) +
                 ", it holds " + std::to_string(file_.size()));
      }
      if (section.count > section.room) {
        failHere(name + " claims " + std::to_string(section.count) + " splats in room for " +
                 std::to_string(section.room));
      }
      data = end;
      total += section.count;
      if (section.count == 0) continue;
      cloud_.sh_degree = std::max(cloud_.sh_degree, section.degree);
      sections_.push_back(section);
    }
    if (total != count_ || count_ == 0) {
      failHere("it claims " + std::to_string(count_) + " splats at byte 16; its sections hold " +
               std::to_string(total) + ", and one or more is expected");
    }
  }

  Section readSectionHeader(uint64_t offset) const {
    std::array<uint8_t, 48> header;
    file_.readAt(offset, header.data(), header.size());
    Section section;
    section.header_offset = offset;
    section.count = loadLittleEndian<uint32_t>(&header[0]);
    section.room = loadLittleEndian<uint32_t>(&header[4]);
    section.capacity = loadLittleEndian<uint32_t>(&header[8]);
    section.buckets = loadLittleEndian<uint32_t>(&header[12]);
    section.block_size = static_cast<double>(loadFloat(&header[16]));
    section.bucket_bytes = loadLittleEndian<uint16_t>(&header[20]);
    section.range = loadLittleEndian<uint32_t>(&header[24]);
    section.full = loadLittleEndian<uint32_t>(&header[32]);
    section.partial = loadLittleEndian<uint32_t>(&header[36]);
    const uint16_t degree = loadLittleEndian<uint16_t>(&header[40]);
    if (degree > 3) {
      failHere("its harmonic degree is " + std::to_string(degree) + " at byte " +
               std::to_string(offset + 40) + "; 0 to 3 is allowed");
    }
    section.degree = degree;
    if (section.range == 0) section.range = layout_.range;
    section.row_bytes = layout_.position * 3 + layout_.shape * 7 + 4 +
                        layout_.harmonic * (shCoefficientCount(degree) - 1) * 3;
    return section;
  }

  /// Centre of each splat's bucket: full ones first, then those with a length of their own.
  std::vector<uint32_t> bucketsOf(const Section& section) const {
    const std::string name = "section at byte " + std::to_string(section.header_offset);
    if (section.bucket_bytes < kCentreBytes || !std::isfinite(section.block_size)) {
      failHere("the " + name + " has buckets of " + std::to_string(section.bucket_bytes) +
               " bytes and blocks of " + std::to_string(section.block_size) +
               "; 12 bytes and a finite size are expected");
    }
    std::vector<uint32_t> buckets(static_cast<size_t>(section.count));
    const uint64_t in_full = std::min(section.full * section.capacity, section.count);
    for (uint64_t i = 0; i < in_full; ++i) {
      buckets[static_cast<size_t>(i)] = static_cast<uint32_t>(i / section.capacity);
    }
    uint64_t next = in_full;
    for (uint64_t p = 0; p < section.partial && next < section.count; ++p) {
      std::array<uint8_t, 4> length;
      file_.readAt(section.lengths_at + p * 4, length.data(), length.size());
      const uint64_t end =
          std::min(section.count, next + loadLittleEndian<uint32_t>(length.data()));
      for (; next < end; ++next) {
        buckets[static_cast<size_t>(next)] = static_cast<uint32_t>(section.full + p);
      }
    }
    if (next < section.count || buckets.back() >= section.buckets) {
      failHere("the " + name + " has " + std::to_string(section.buckets) + " buckets, " +
               std::to_string(section.full) + " full and " + std::to_string(section.partial) +
               " partly filled, which do not hold its " + std::to_string(section.count) +
               " splats");
    }
    return buckets;
  }

  double harmonic(const uint8_t* bytes) const {
    if (layout_.harmonic == 4) return static_cast<double>(loadFloat(bytes));
    if (layout_.harmonic == 2) {
      return static_cast<double>(halfToFloat(loadLittleEndian<uint16_t>(bytes)));
    }
    return harmonic_low_ + *bytes / 255.0 * (harmonic_high_ - harmonic_low_);
  }

  float shape(const uint8_t* bytes) const {
    return layout_.shape == 4 ? loadFloat(bytes) : halfToFloat(loadLittleEndian<uint16_t>(bytes));
  }

  void decode(const Section& section, size_t first) {
    const bool packed = layout_.position == 2;
    std::vector<uint32_t> buckets;
    ByteVector centres;
    if (packed) {
      buckets = bucketsOf(section);
      centres.resize(static_cast<size_t>(section.buckets * section.bucket_bytes));
      file_.readAt(section.centres_at, centres.data(), centres.size());
    }
    const double step = section.block_size / 2.0 / section.range;
    parallelFor(static_cast<size_t>(section.count), kGrain, [&](size_t begin, size_t end) {
      ByteVector block((end - begin) * section.row_bytes);
      file_.readAt(section.splats_at + begin * uint64_t{section.row_bytes}, block.data(),
                   block.size());
      for (size_t i = begin; i < end; ++i) {
        const uint8_t* row = &block[(i - begin) * section.row_bytes];
        float* position = &cloud_.positions[(first + i) * 3];
        for (size_t k = 0; k < 3; ++k) {
          if (!packed) {
            position[k] = loadFloat(row + k * 4);
            continue;
          }
          const uint8_t* centre = &centres[buckets[i] * section.bucket_bytes + k * 4];
          const double number = loadLittleEndian<uint16_t>(row + k * 2);
          position[k] = static_cast<float>((number - section.range) * step +
                                           static_cast<double>(loadFloat(centre)));
        }
        decodeRest(row + layout_.position * 3, section.degree, first + i);
      }
    });
  }

  /// In: bytes of scale, rotation (w,x,y,z), colour and opacity, harmonics.
  void decodeRest(const uint8_t* bytes, int degree, size_t i) {
    for (size_t k = 0; k < 3; ++k) cloud_.scales[i * 3 + k] = shape(bytes + k * layout_.shape);
    bytes += 3 * layout_.shape;
    float* q = &cloud_.rotations[i * 4];
    for (size_t k = 0; k < 4; ++k) q[k] = shape(bytes + k * layout_.shape);
    normaliseRotation(q);
    bytes += 4 * layout_.shape;
    float* sh = &cloud_.sh[i * cloud_.shStride()];
    for (size_t c = 0; c < 3; ++c) sh[c] = static_cast<float>((bytes[c] / 255.0 - 0.5) / kC0);
    cloud_.opacities[i] = static_cast<float>(bytes[3] / 255.0);
    bytes += 4;
    // Band by band, each channel by channel.
    size_t number = 0;
    for (int l = 1; l <= degree; ++l) {
      const size_t band = static_cast<size_t>(2 * l + 1);
      for (size_t c = 0; c < 3; ++c) {
        for (size_t m = 0; m < band; ++m, ++number) {
          sh[(static_cast<size_t>(l * l) + m) * 3 + c] =
              static_cast<float>(harmonic(bytes + number * layout_.harmonic));
        }
      }
    }
  }

  InputFile file_;
  Progress* progress_;
  uint64_t section_count_ = 0;
  uint64_t count_ = 0;
  Layout layout_{};
  double harmonic_low_ = 0, harmonic_high_ = 0;
  std::vector<Section> sections_;
  SplatCloud cloud_;
};

}  // namespace

SplatCloud readKsplat(const std::string& path, Progress* progress) {
  return Reader(path, progress).read();
}

}  // namespace stipple
