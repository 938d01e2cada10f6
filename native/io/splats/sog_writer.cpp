// Based on: PlayCanvas, The SOG Format, version 2 (developer.playcanvas.com). Differs: numbers are
// rounded to the nearest step, not down.
#include <algorithm>
#include <array>
#include <atomic>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/number_reading.h"
#include "base/parallel.h"
#include "io/bytes/input_file.h"
#include "io/bytes/output_file.h"
#include "io/bytes/zip_file.h"
#include "io/splats/cloud_parts.h"
#include "io/splats/ply/ply_file.h"
#include "io/splats/sog_codebook.h"
#include "io/splats/sog_file.h"
#include "io/splats/sog_meta.h"
#include "io/webp_image.h"
#include "math/clusters/vector_palette.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr size_t kGrain = 4096;
constexpr int kMaxBands = 3;
constexpr size_t kPaletteRow = 64;
constexpr size_t kMaxPalette = 65536;
// Its exponential is the smallest number that rounds to 0 in float32, so a scale of 0 comes back.
constexpr float kLogOfZero = -104.0f;
constexpr char kStage[] = "Writing splats";

float logScale(float scale) {
  return scale > 0.0f ? static_cast<float>(std::log(static_cast<double>(scale))) : kLogOfZero;
}

/// sign(x) ln(1 + |x|): even relative steps far out, even steps near the origin.
double logPosition(float value) {
  return std::copysign(std::log1p(std::abs(static_cast<double>(value))),
                       static_cast<double>(value));
}

/// The double whose shortest text is that of the float: what readers parse back to the same float.
double shortest(float value) {
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof(digits), value).ptr;
  double parsed = 0;
  readNumber(digits, end, parsed);
  return parsed;
}

Json toJson(const Codebook& codebook) {
  Json list = Json::array();
  for (const float value : codebook.values) list.push_back(shortest(value));
  return list;
}

/// Powers of two of 1024 with the number of splats, at most 65,536, as other writers choose.
size_t paletteLimit(size_t splats) {
  size_t limit = 1024;
  while (limit * 2 <= std::min(splats, kMaxPalette)) limit *= 2;
  return limit;
}

class Encoder {
 public:
  Encoder(const SplatCloud& cloud, const SogOptions& options, Progress* progress)
      : cloud_(cloud), options_(options), progress_(progress), order_(cloud.size()) {
    // Sides are multiples of 4; an empty cloud has pictures too.
    const double root = std::sqrt(static_cast<double>(cloud.size()));
    width_ = std::max<uint64_t>(4, static_cast<uint64_t>(std::ceil(root / 4)) * 4);
    height_ = std::max<uint64_t>(4, (cloud.size() + width_ * 4 - 1) / (width_ * 4) * 4);
    if (width_ > kMaxWebpSide || height_ > kMaxWebpSide) {
      fail(ErrorCode::kUnsupported, "the cloud has " + std::to_string(cloud.size()) +
                                        " splats; one SOG scene holds at most 268 million");
    }
  }

  std::vector<SogPart> encode() {
    fillOrder();
    meta_["version"] = 2;
    meta_["asset"]["generator"] = "stipple";
    meta_["count"] = cloud_.size();
    if (cloud_.antialias == Antialias::kMip) meta_["model"] = "antialiased";
    if (cloud_.colour_space == ColourSpace::kLinear) meta_[kSogColourSpaceKey] = kColourSpaceLinear;
    if (cloud_.frame != Frame::kUnknown && cloud_.frame != Frame::kRDF) {
      meta_[kSogFrameKey] = frameName(cloud_.frame);
    }
    encodeMeans();
    advance(progress_, 0.05, kStage);
    makeCodebooks();
    encodeScales();
    encodeRotations();
    encodeColours();
    advance(progress_, 0.2, kStage);
    encodeHarmonics();
    return finish();
  }

 private:
  struct Picture {
    std::string name;
    RgbaBytes image;
  };

  /// Room for one pixel per splat, opaque; names and pictures keep their order.
  std::vector<uint8_t>& addPicture(const std::string& name) {
    pictures_.push_back({name, {}});
    RgbaBytes& image = pictures_.back().image;
    image.width = static_cast<uint32_t>(width_);
    image.height = static_cast<uint32_t>(height_);
    image.bytes.assign(static_cast<size_t>(image.pixelCount() * 4), 0);
    return image.bytes;
  }

  /// fill(pixel, i) for every splat i and its four bytes.
  template <typename Fill>
  void fillPixels(std::vector<uint8_t>& bytes, const Fill& fill) const {
    parallelFor(order_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t k = begin; k < end; ++k) fill(&bytes[k * 4], size_t{order_[k]});
    });
  }

  void fillOrder() {
    for (size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<uint32_t>(i);
    if (options_.sort) sortAlongMortonCurve(cloud_.positions, order_.data(), order_.size());
  }

  void encodeMeans() {
    std::array<double, 3> low{};
    std::array<double, 3> high{};
    for (size_t axis = 0; axis < 3; ++axis) {
      if (cloud_.size() == 0) break;
      const auto [least, most] = boundsOf(axis);
      low[axis] = logPosition(least);
      high[axis] = logPosition(most);
    }
    std::vector<uint16_t> codes(cloud_.size() * 3);
    parallelFor(cloud_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin * 3; i < end * 3; ++i) {
        const size_t axis = i % 3;
        const double side = high[axis] - low[axis];
        const double share = side > 0 ? (logPosition(cloud_.positions[i]) - low[axis]) / side : 0.0;
        codes[i] = static_cast<uint16_t>(std::lround(std::clamp(share, 0.0, 1.0) * 65535.0));
      }
    });
    fillPixels(addPicture("means_l.webp"), [&](uint8_t* pixel, size_t i) {
      for (size_t axis = 0; axis < 3; ++axis) {
        pixel[axis] = static_cast<uint8_t>(codes[i * 3 + axis] & 0xff);
      }
      pixel[3] = 255;
    });
    fillPixels(addPicture("means_u.webp"), [&](uint8_t* pixel, size_t i) {
      for (size_t axis = 0; axis < 3; ++axis) {
        pixel[axis] = static_cast<uint8_t>(codes[i * 3 + axis] >> 8);
      }
      pixel[3] = 255;
    });
    meta_["means"] = {{"mins", low}, {"maxs", high}, {"files", {"means_l.webp", "means_u.webp"}}};
  }

  std::pair<float, float> boundsOf(size_t axis) const {
    float least = cloud_.positions[axis];
    float most = least;
    for (size_t i = axis; i < cloud_.positions.size(); i += 3) {
      least = std::min(least, cloud_.positions[i]);
      most = std::max(most, cloud_.positions[i]);
    }
    return {least, most};
  }

  /// Both codebooks, side by side: most of their time is one thread's sorting.
  void makeCodebooks() {
    logarithms_.resize(cloud_.scales.size());
    colours_.resize(cloud_.size() * 3);
    parallelFor(cloud_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin * 3; i < end * 3; ++i) logarithms_[i] = logScale(cloud_.scales[i]);
      for (size_t i = begin; i < end; ++i) {
        std::copy_n(&cloud_.sh[i * cloud_.shStride()], 3, &colours_[i * 3]);
      }
    });
    parallelFor(2, 1, [&](size_t which, size_t) {
      (which == 0 ? scale_codebook_ : colour_codebook_) =
          makeCodebook(which == 0 ? logarithms_ : colours_);
    });
  }

  void encodeScales() {
    const NearestCode code(scale_codebook_);
    fillPixels(addPicture("scales.webp"), [&](uint8_t* pixel, size_t i) {
      for (size_t axis = 0; axis < 3; ++axis) {
        pixel[axis] = code(logarithms_[i * 3 + axis]);
      }
      pixel[3] = 255;
    });
    meta_["scales"] = {{"codebook", toJson(scale_codebook_)}, {"files", {"scales.webp"}}};
  }

  void encodeRotations() {
    fillPixels(addPicture("quats.webp"), [&](uint8_t* pixel, size_t i) {
      const float* q = &cloud_.rotations[i * 4];
      double squares = 0;
      size_t largest = 0;
      for (size_t k = 0; k < 4; ++k) {
        squares += static_cast<double>(q[k]) * static_cast<double>(q[k]);
        if (std::abs(q[k]) > std::abs(q[largest])) largest = k;
      }
      // q and -q turn alike; the largest component is not stored and taken as positive. The others
      // are at most sqrt(1/2).
      constexpr double kRoot = std::numbers::sqrt2;
      const double factor = (q[largest] < 0 ? -kRoot : kRoot) / std::sqrt(squares);
      size_t next = 0;
      for (size_t k = 0; k < 4; ++k) {
        if (k == largest) continue;
        const double share = (static_cast<double>(q[k]) * factor + 1.0) * 0.5;
        pixel[next++] = static_cast<uint8_t>(std::lround(std::clamp(share, 0.0, 1.0) * 255.0));
      }
      pixel[3] = static_cast<uint8_t>(252 + largest);
    });
    meta_["quats"] = {{"files", {"quats.webp"}}};
  }

  void encodeColours() {
    const NearestCode code(colour_codebook_);
    fillPixels(addPicture("sh0.webp"), [&](uint8_t* pixel, size_t i) {
      for (size_t c = 0; c < 3; ++c) {
        pixel[c] = code(colours_[i * 3 + c]);
      }
      pixel[3] =
          static_cast<uint8_t>(std::lround(static_cast<double>(cloud_.opacities[i]) * 255.0));
    });
    meta_["sh0"] = {{"codebook", toJson(colour_codebook_)}, {"files", {"sh0.webp"}}};
  }

  void encodeHarmonics() {
    const int bands = std::min(cloud_.sh_degree, kMaxBands);
    if (bands == 0 || cloud_.size() == 0) return;
    const size_t row = shCoefficientCount(bands) - 1;
    const size_t width = row * 3;
    std::vector<float> vectors(cloud_.size() * width);
    parallelFor(cloud_.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        std::copy_n(&cloud_.sh[i * cloud_.shStride() + 3], width, &vectors[i * width]);
      }
    });
    PaletteOptions palette_options;
    palette_options.max_count = paletteLimit(cloud_.size());
    palette_options.rounds = options_.palette_rounds;
    palette_ = makeVectorPalette(vectors.data(), cloud_.size(), width, palette_options, nullptr);
    advance(progress_, 0.7, kStage);
    // Its codebook is one thread's work, done while others pack the rest.
    pictures_.push_back({"shN_centroids.webp", {}});
    centroids_ = pictures_.size() - 1;
    fillPixels(addPicture("shN_labels.webp"), [&](uint8_t* pixel, size_t i) {
      pixel[0] = static_cast<uint8_t>(palette_.labels[i] & 0xff);
      pixel[1] = static_cast<uint8_t>(palette_.labels[i] >> 8);
      pixel[3] = 255;
    });
  }

  /// The palette as a picture, 64 vectors in a row.
  void encodeCentroids(RgbaBytes& centroids) {
    const int bands = std::min(cloud_.sh_degree, kMaxBands);
    const size_t row = shCoefficientCount(bands) - 1;
    const Codebook codebook = makeCodebook(palette_.vectors);
    const NearestCode code(codebook);
    centroids.width = static_cast<uint32_t>(kPaletteRow * row);
    centroids.height = static_cast<uint32_t>((palette_.count + kPaletteRow - 1) / kPaletteRow);
    centroids.bytes.assign(static_cast<size_t>(centroids.pixelCount() * 4), 0);
    for (size_t pixel = 0; pixel < palette_.count * row; ++pixel) {
      for (size_t c = 0; c < 3; ++c) {
        centroids.bytes[pixel * 4 + c] = code(palette_.vectors[pixel * 3 + c]);
      }
      centroids.bytes[pixel * 4 + 3] = 255;
    }
    meta_["shN"] = {{"count", palette_.count},
                    {"bands", bands},
                    {"codebook", toJson(codebook)},
                    {"files", {"shN_centroids.webp", "shN_labels.webp"}}};
  }

  std::vector<SogPart> finish() {
    std::vector<SogPart> parts(pictures_.size());
    std::atomic<size_t> done{0};
    parallelFor(pictures_.size(), 1, [&](size_t begin, size_t) {
      Picture& picture = pictures_[begin];
      if (begin == centroids_) encodeCentroids(picture.image);
      parts[begin] = {picture.name, encodeWebp(picture.image, picture.name)};
      picture.image = {};
      advance(progress_,
              0.7 + 0.3 * static_cast<double>(++done) / static_cast<double>(pictures_.size() + 1),
              kStage);
    });
    const std::string text = meta_.dump();
    parts.push_back({"meta.json", {text.begin(), text.end()}});
    return parts;
  }

  const SplatCloud& cloud_;
  SogOptions options_;
  Progress* progress_;
  std::vector<uint32_t> order_;
  uint64_t width_ = 0;
  uint64_t height_ = 0;
  std::vector<float> logarithms_;  ///< [N,3] of scales
  std::vector<float> colours_;     ///< [N,3]
  Codebook scale_codebook_;
  Codebook colour_codebook_;
  VectorPalette palette_;
  Json meta_;
  std::vector<Picture> pictures_;
  size_t centroids_ =
      std::numeric_limits<size_t>::max();  ///< which picture; none without harmonics
};

void writeZip(const std::vector<SogPart>& parts, const std::string& path) {
  OutputFile file(path);
  ZipWriter zip(file);
  for (const SogPart& part : parts) zip.add(part.name, part.bytes);
  zip.finish();
  file.commit();
}

void writeFolder(const std::vector<SogPart>& parts, const std::string& path) {
  std::vector<std::unique_ptr<OutputFile>> files;
  for (const SogPart& part : parts) {
    const fs::path name = &part == &parts.back() ? fs::path(path).filename() : fs::path(part.name);
    files.push_back(std::make_unique<OutputFile>((fs::path(path).parent_path() / name).string()));
    files.back()->write(part.bytes.data(), part.bytes.size());
    files.back()->handOver();
  }
  for (const auto& file : files) file->commit();
}

}  // namespace

std::vector<SogPart> encodeSog(const SplatCloud& cloud, const SogOptions& options,
                               Progress* progress) {
  return Encoder(cloud, options, progress).encode();
}

void writeSog(const SplatCloud& cloud, const std::string& path, const SogOptions& options,
              Progress* progress) {
  const std::vector<SogPart> parts = encodeSog(cloud, options, progress);
  if (lowerExtension(path) == ".json") {
    writeFolder(parts, path);
  } else {
    writeZip(parts, path);
  }
  advance(progress, 1.0, kStage);
}

double estimateSog(uint64_t count, int degree, const SplatWriteOptions&) {
  constexpr double kMetaBytes = 9000;     // codebooks as text, most of it
  constexpr double kPlainBytes = 13.5;    // of a splat, after packing
  constexpr double kLabelBytes = 2;       // which vector of the palette
  constexpr double kPaletteBytes = 0.95;  // of a number of a palette's vector, after packing
  const double splats = static_cast<double>(count);
  const double plain = kMetaBytes + kPlainBytes * splats;
  if (degree == 0) return plain;
  const double palette = static_cast<double>(paletteLimit(count)) * higherHarmonics(degree);
  return plain + kLabelBytes * splats + kPaletteBytes * palette;
}

}  // namespace stipple
