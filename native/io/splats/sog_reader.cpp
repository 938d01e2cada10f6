// Based on: PlayCanvas, The SOG Format, version 2 (developer.playcanvas.com): bytes of WebP
// pictures are looked up in tables; rotations are the three smallest components of a quaternion.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <numbers>

#include "base/default_init_vector.h"
#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/input_file.h"
#include "io/bytes/limits.h"
#include "io/bytes/zip_file.h"
#include "io/splats/sog_file.h"
#include "io/splats/sog_level_names.h"
#include "io/splats/sog_meta.h"
#include "io/splats/splat_check.h"
#include "io/webp_image.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr size_t kGrain = 4096;
constexpr uint64_t kPaletteRow = 64;
constexpr uint64_t kMaxPalette = 65536;
// A 2DGS splat has two scales; the third axis is made this much shorter than the shorter of them.
constexpr float kFlatness = 1e-3f;
// A table of all 16-bit codes pays off from this many splats on.
constexpr uint64_t kCodes = 65536;

// Of a cloud's bytes over those of its pictures, real scenes have 7 to 15.
constexpr uint64_t kMostEarly = 32;
constexpr size_t kPaletteAhead = 8;

/// The files of a scene: entries of a zip, or files of a folder.
class Files {
 public:
  explicit Files(const std::string& path) {
    std::error_code ignored;
    if (fs::is_directory(path, ignored)) {
      folder_ = path;
      return;
    }
    file_ = std::make_unique<InputFile>(path);
    char start[2] = {};
    if (file_->size() >= 2) file_->readAt(0, start, 2);
    if (start[0] == 'P' && start[1] == 'K') {
      zip_ = std::make_unique<ZipReader>(*file_);
    } else {
      folder_ = fs::path(path).parent_path();
      meta_ = fs::path(path).filename().string();
    }
  }

  /// What messages call a file.
  std::string name(const std::string& file) const {
    return zip_ ? file_->path() + ": " + file : (folder_ / file).string();
  }

  const std::string& metaFile() const { return meta_; }

  std::vector<uint8_t> read(const std::string& file, uint64_t limit) const {
    if (zip_) return zip_->read(file, limit);
    const InputFile input((folder_ / file).string());
    if (input.size() > limit) {
      fail(ErrorCode::kFormat, input.path() + " holds " + std::to_string(input.size()) +
                                   " bytes; at most " + std::to_string(limit) + " belong there");
    }
    std::vector<uint8_t> bytes(static_cast<size_t>(input.size()));
    input.readAt(0, bytes.data(), bytes.size());
    return bytes;
  }

  uint64_t storedBytes(const std::string& file) const {
    return zip_ ? zip_->storedBytes(file) : InputFile((folder_ / file).string()).size();
  }

 private:
  std::unique_ptr<InputFile> file_;
  std::unique_ptr<ZipReader> zip_;
  fs::path folder_;
  std::string meta_ = kSogMetaName;
};

class Reader {
 public:
  Reader(const std::string& path, Progress* progress)
      : files_(path), progress_(progress), meta_(readMeta()) {
    for (size_t byte = 0; byte < 256; ++byte) {
      components_[byte] =
          (static_cast<double>(byte) / 255.0 * 2.0 - 1.0) * (std::numbers::sqrt2 / 2);
    }
  }

  /// Bytes of the scene's images as they are stored.
  uint64_t storedBytes() const { return stored_bytes_; }

  SplatCloud read() {
    stored_bytes_ = checkCount();
    decodePictures(stored_bytes_);
    advance(progress_, 0.5, "Reading splats");
    cloud_.antialias = meta_.antialias;
    cloud_.colour_space = meta_.colour_space;
    cloud_.frame = meta_.frame;
    allocate(meta_.bands);
    fillPalette();
    bad_.assign(rangeCount(cloud_.size(), kGrain), std::string());
    parallelFor(cloud_.size(), kGrain, [this](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        prefetchPalette(std::min(i + kPaletteAhead, end - 1));
        if (!fillSplat(i, &bad_[begin / kGrain])) return;
      }
    });
    for (const std::string& what : bad_) {
      if (!what.empty()) fail(ErrorCode::kFormat, what);
    }
    advance(progress_, 1.0, "Reading splats");
    return std::move(cloud_);
  }

 private:
  enum Picture { kMeansLow, kMeansHigh, kScales, kRotations, kColours, kLabels, kCentroids };

  SogMeta readMeta() const {
    const std::vector<uint8_t> bytes = files_.read(files_.metaFile(), kMaxSogMetaBytes);
    return parseSogMeta(std::string(bytes.begin(), bytes.end()), files_.name(files_.metaFile()));
  }

  std::vector<std::string> pictureNames() const {
    std::vector<std::string> names = {meta_.means_low, meta_.means_high, meta_.scales_file,
                                      meta_.rotations_file, meta_.colours_file};
    if (meta_.hasHarmonics()) {
      names.push_back(meta_.labels_file);
      names.push_back(meta_.centroids_file);
    }
    return names;
  }

  /// Returns the bytes of all pictures as they are stored.
  uint64_t checkCount() const {
    uint64_t bytes = 0;
    for (const std::string& name : pictureNames()) bytes += files_.storedBytes(name);
    // Version 1 tells the degree only by a picture.
    const int degree = meta_.hasHarmonics() && meta_.bands == 0 ? 3 : meta_.bands;
    requireAllowedSplats(meta_.count, degree, bytes, files_.name(files_.metaFile()));
    return bytes;
  }

  void allocate(int degree) {
    cloud_.sh_degree = degree;
    cloud_.resize(static_cast<size_t>(meta_.count));
  }

  void decodePictures(uint64_t stored_bytes) {
    const std::vector<std::string> names = pictureNames();
    // Writers pad the sides to multiples of 4.
    const uint64_t splat_pixels = std::max<uint64_t>(meta_.count * 4, 4096);
    const uint64_t palette_pixels = kMaxPalette * (shCoefficientCount(3) - 1);
    pictures_.resize(names.size());
    // Touching fresh memory takes a third as long as decoding: done beside it, where the count
    // does not claim far more than the pictures can hold.
    const int degree = meta_.bands;  // version 1 tells it only by a picture
    const uint64_t floats = 11 + shCoefficientCount(degree) * 3;
    const bool allocates = meta_.count * floats * sizeof(float) <= stored_bytes * kMostEarly;
    parallelFor(names.size() + 2, 1, [&](size_t begin, size_t) {
      if (begin == names.size()) {
        if (allocates) allocate(degree);
        return;
      }
      if (begin > names.size()) {
        fillPositionTables();
        return;
      }
      const uint64_t most = begin == kCentroids ? palette_pixels : splat_pixels;
      const std::vector<uint8_t> bytes = files_.read(names[begin], most * 4 + (1 << 16));
      RgbaBytes& picture = pictures_[begin];
      picture = decodeWebp(bytes, most, files_.name(names[begin]));
      if (begin == kCentroids) {
        requirePalette(picture);
      } else if (picture.pixelCount() < meta_.count) {
        fail(ErrorCode::kFormat, files_.name(names[begin]) + " has " +
                                     std::to_string(picture.width) + " x " +
                                     std::to_string(picture.height) + " pixels; " +
                                     std::to_string(meta_.count) + " splats need one each");
      }
    });
  }

  /// One coefficient after the other, 64 vectors in a row; version 1 tells the degree only so.
  void requirePalette(const RgbaBytes& picture) {
    for (int bands = 1; bands <= 3; ++bands) {
      if (picture.width != kPaletteRow * (shCoefficientCount(bands) - 1)) continue;
      if (meta_.bands != 0 && meta_.bands != bands) break;
      meta_.bands = bands;
      return;
    }
    fail(ErrorCode::kFormat,
         files_.name(meta_.centroids_file) + " is " + std::to_string(picture.width) +
             " pixels wide; " +
             (meta_.bands == 0
                  ? std::string("192, 512 or 960")
                  : std::to_string(kPaletteRow * (shCoefficientCount(meta_.bands) - 1))) +
             " are needed for its harmonics");
  }

  float position(size_t axis, uint32_t code) const {
    const double low = meta_.means_min[axis];
    const double value = low + (meta_.means_max[axis] - low) * (code / 65535.0);
    const double most = static_cast<double>(std::numeric_limits<float>::max());
    return static_cast<float>(std::copysign(std::min(std::expm1(std::abs(value)), most), value));
  }

  void fillPositionTables() {
    if (meta_.count < kCodes) return;
    for (std::vector<float>& table : positions_) table.resize(kCodes);
    parallelFor(3 * kCodes, kGrain, [this](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const size_t axis = i / kCodes;
        positions_[axis][i % kCodes] = position(axis, static_cast<uint32_t>(i % kCodes));
      }
    });
  }

  void fillPalette() {
    if (!meta_.hasHarmonics()) return;
    const RgbaBytes& picture = pictures_[kCentroids];
    const size_t row = shCoefficientCount(meta_.bands) - 1;
    // As many as the picture holds; 'count' may promise more, and some writers do.
    palette_count_ =
        std::min<uint64_t>(uint64_t{picture.height} * kPaletteRow, meta_.palette_count);
    palette_.resize(static_cast<size_t>(palette_count_) * row * 3);
    parallelFor(static_cast<size_t>(palette_count_) * row, kGrain, [&](size_t begin, size_t end) {
      for (size_t pixel = begin; pixel < end; ++pixel) {
        for (size_t c = 0; c < 3; ++c) {
          palette_[pixel * 3 + c] = meta_.harmonics[picture.bytes[pixel * 4 + c]];
        }
      }
    });
  }

  size_t labelOf(size_t i) const {
    const uint8_t* bytes = &pictures_[kLabels].bytes[i * 4];
    return bytes[0] | static_cast<size_t>(bytes[1]) << 8;
  }

  /// Vectors of a palette of several megabytes come in any order.
  void prefetchPalette(size_t i) const {
    if (!meta_.hasHarmonics()) return;
    const size_t label = labelOf(i);
    if (label >= palette_count_) return;
    const size_t rest = cloud_.shStride() - 3;
    const float* vector = &palette_[label * rest];
    for (size_t k = 0; k < rest; k += 16) __builtin_prefetch(vector + k);
  }

  /// Returns false, and what is wrong, where there is something.
  bool fillSplat(size_t i, std::string* bad) {
    const uint8_t* low = &pictures_[kMeansLow].bytes[i * 4];
    const uint8_t* high = &pictures_[kMeansHigh].bytes[i * 4];
    for (size_t axis = 0; axis < 3; ++axis) {
      const uint32_t code = low[axis] | static_cast<uint32_t>(high[axis]) << 8;
      cloud_.positions[i * 3 + axis] =
          positions_[axis].empty() ? position(axis, code) : positions_[axis][code];
    }
    const uint8_t* scales = &pictures_[kScales].bytes[i * 4];
    float* scale = &cloud_.scales[i * 3];
    for (size_t axis = 0; axis < 3; ++axis) scale[axis] = meta_.scales[axis][scales[axis]];
    if (meta_.flat) scale[2] = kFlatness * std::min(scale[0], scale[1]);

    const uint8_t* colour = &pictures_[kColours].bytes[i * 4];
    float* sh = &cloud_.sh[i * cloud_.shStride()];
    for (size_t c = 0; c < 3; ++c) sh[c] = meta_.colours[c][colour[c]];
    cloud_.opacities[i] = meta_.opacities[colour[3]];

    const uint8_t* rotation = &pictures_[kRotations].bytes[i * 4];
    if (!fillRotation(rotation, &cloud_.rotations[i * 4])) {
      *bad = files_.name(meta_.rotations_file) + " has " + std::to_string(rotation[3]) +
             " in the alpha of splat " + std::to_string(i) +
             "; 252 to 255 name the largest component of a rotation";
      return false;
    }
    if (!meta_.hasHarmonics()) return true;
    const size_t label = labelOf(i);
    if (label >= palette_count_) {
      *bad = files_.name(meta_.labels_file) + " names vector " + std::to_string(label) +
             " of the palette for splat " + std::to_string(i) + "; it holds " +
             std::to_string(palette_count_);
      return false;
    }
    constexpr size_t kRestOf3 = 45;
    const size_t rest = cloud_.shStride() - 3;
    const float* vector = &palette_[label * rest];
    if (rest == kRestOf3) {
      std::memcpy(sh + 3, vector, kRestOf3 * sizeof(float));  // a known length needs no call
    } else {
      std::copy_n(vector, rest, sh + 3);
    }
    return true;
  }

  /// Three components in bytes; the largest follows from the length, and is positive.
  bool fillRotation(const uint8_t* bytes, float* wxyz) const {
    if (bytes[3] < 252) return false;
    const size_t largest = bytes[3] - size_t{252};
    std::array<double, 3> parts;
    for (size_t k = 0; k < 3; ++k) parts[k] = components_[bytes[k]];
    const double squares = parts[0] * parts[0] + parts[1] * parts[1] + parts[2] * parts[2];
    // Damaged bytes may be longer than 1 together.
    if (squares > 1.0) {
      for (double& part : parts) part /= std::sqrt(squares);
    }
    for (size_t k = 0; k < 3; ++k) wxyz[k + (k < largest ? 0 : 1)] = static_cast<float>(parts[k]);
    wxyz[largest] = static_cast<float>(std::sqrt(std::max(0.0, 1.0 - squares)));
    return true;
  }

  Files files_;
  Progress* progress_;
  SogMeta meta_;
  uint64_t stored_bytes_ = 0;
  std::vector<RgbaBytes> pictures_;
  std::array<std::vector<float>, 3> positions_;
  DefaultInitVector<float> palette_;  ///< [palette_count, (bands+1)^2 - 1, 3]
  uint64_t palette_count_ = 0;
  SplatCloud cloud_;
  std::vector<std::string> bad_;
  std::array<double, 256> components_;  ///< of rotations, by byte
};

}  // namespace

bool startsAsSog(const SplatFileStart& start) {
  if (start.is_folder) {
    std::error_code ignored;
    return fs::exists(fs::path(start.path) / kSogMetaName, ignored);
  }
  return start.name == kSogMetaName || start.bytes.rfind("PK\3\4", 0) == 0;
}

SplatCloud readSog(const std::string& path, Progress* progress) {
  return Reader(path, progress).read();
}

SplatCloud readSogPart(const std::string& path, uint64_t& stored_bytes) {
  Reader reader(path, nullptr);
  SplatCloud cloud = reader.read();
  stored_bytes = reader.storedBytes();
  return cloud;
}

}  // namespace stipple
