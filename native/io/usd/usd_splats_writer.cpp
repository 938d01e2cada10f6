// Based on: OpenUSD 26.03, schema UsdVol (ParticleField3DGaussianSplat); Pixar, "Usdz File Format
// Specification" 1.3 (stored entries, their bytes at multiples of 64, the layer first).
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/input_file.h"
#include "io/bytes/output_file.h"
#include "io/bytes/zip_file.h"
#include "io/usd/usd_names.h"
#include "io/usd/usd_splats.h"

namespace stipple {

namespace {

constexpr size_t kBlockRows = 4096;
constexpr size_t kBlocksAtOnce = 32;
constexpr uint64_t kPackageAlignment = 64;
constexpr char kStage[] = "Writing splats";
constexpr double kReach = 3.0;  ///< standard deviations that the extent holds
/// Of a number with what stands between it and the next, in scenes: measured.
constexpr double kBytesOfNumber = 12.5;

using Sink = std::function<void(const std::string& text)>;

void putNumber(float value, std::string& text) {
  // The shortest decimal that reads back as the same number.
  char digits[32];
  text.append(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
}

/// "(a, b, c)", or "a" alone.
void putTuple(const float* values, size_t width, std::string& text) {
  if (width > 1) text += '(';
  for (size_t k = 0; k < width; ++k) {
    if (k > 0) text += ", ";
    putNumber(values[k], text);
  }
  if (width > 1) text += ')';
}

class LayerWriter {
 public:
  LayerWriter(const SplatCloud& cloud, Sink sink, Progress* progress)
      : cloud_(cloud), sink_(std::move(sink)), progress_(progress) {
    whole_ = static_cast<double>(cloud.size() * (11 + cloud.shStride()));
  }

  void write() {
    sink_(head());
    putArray("point3f[]", kUsdPositions, cloud_.positions, 3, 3);
    putArray("quatf[]", kUsdOrientations, cloud_.rotations, 4, 4);
    putArray("float3[]", kUsdScales, cloud_.scales, 3, 3);
    putArray("float[]", kUsdOpacities, cloud_.opacities, 1, 1);
    sink_("    uniform int " + std::string(kUsdDegree) + " = " + std::to_string(cloud_.sh_degree) +
          "\n");
    putArray("float3[]", kUsdCoefficients, cloud_.sh, 3, cloud_.shStride());
    sink_("}\n");
  }

 private:
  std::string head() const {
    std::string text =
        "#usda 1.0\n(\n    defaultPrim = \"Splats\"\n    doc = \"Written by Stipple\"\n"
        "    metersPerUnit = 1\n    upAxis = \"";
    text += cloud_.frame == kUsdFrameOfZUp ? 'Z' : 'Y';
    text += "\"\n)\n\ndef " + std::string(kUsdSplats) + " \"Splats\"";
    std::string custom;
    if (cloud_.antialias == Antialias::kMip) addCustom(kUsdAntialiasKey, kUsdMip, custom);
    if (cloud_.frame != kUsdFrame && cloud_.frame != kUsdFrameOfZUp) {
      addCustom(kUsdFrameKey, frameName(cloud_.frame), custom);
    }
    const bool is_linear = cloud_.colour_space == ColourSpace::kLinear;
    if (is_linear || !custom.empty()) {
      text += " (\n";
      if (is_linear) text += "    prepend apiSchemas = [\"ColorSpaceAPI\"]\n";
      if (!custom.empty()) {
        text += "    customData = {\n        dictionary " + std::string(kUsdGroup) + " = {\n" +
                custom + "        }\n    }\n";
      }
      text += ")";
    }
    text += "\n{\n";
    if (is_linear) {
      text += "    uniform token " + std::string(kUsdColourSpace) + " = \"" + kUsdLinear + "\"\n";
    }
    return text + "    float3[] extent = " + extent() + "\n";
  }

  static void addCustom(const std::string& key, const std::string& value, std::string& custom) {
    custom += "            string " + key + " = \"" + value + "\"\n";
  }

  /// Corners of a box with all splats, whichever way they are turned.
  std::string extent() const {
    std::array<double, 3> low, high;
    low.fill(HUGE_VAL);
    high.fill(-HUGE_VAL);
    for (size_t i = 0; i < cloud_.size(); ++i) {
      const float* scales = &cloud_.scales[i * 3];
      const double reach =
          kReach * static_cast<double>(std::max({scales[0], scales[1], scales[2]}));
      for (size_t axis = 0; axis < 3; ++axis) {
        const double place = static_cast<double>(cloud_.positions[i * 3 + axis]);
        low[axis] = std::min(low[axis], place - reach);
        high[axis] = std::max(high[axis], place + reach);
      }
    }
    std::string text = "[";
    for (const auto& corner : {low, high}) {
      std::array<float, 3> values;
      for (size_t axis = 0; axis < 3; ++axis) {
        constexpr double kLargest = 3.4e38;
        values[axis] = static_cast<float>(std::clamp(corner[axis], -kLargest, kLargest));
      }
      text += text.size() > 1 ? ", " : "";
      putTuple(values.data(), 3, text);
    }
    return text + "]";
  }

  /// An array, the numbers of each splat on a line of their own. In: width, numbers of an element;
  /// row, of a splat. Blocks of rows become text on all threads.
  void putArray(const char* type, const char* name, const std::vector<float>& values, size_t width,
                size_t row) {
    sink_(std::string("    ") + type + " " + name + " = [\n");
    const size_t count = cloud_.size();
    const size_t step = kBlockRows * kBlocksAtOnce;
    std::vector<std::string> blocks(kBlocksAtOnce);
    for (size_t first = 0; first < count; first += step) {
      const size_t rows = std::min(step, count - first);
      const size_t used = (rows + kBlockRows - 1) / kBlockRows;
      parallelFor(used, 1, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b) {
          std::string& text = blocks[b];
          text.clear();
          const size_t from = first + b * kBlockRows;
          for (size_t i = from; i < std::min(from + kBlockRows, count); ++i) {
            for (size_t k = 0; k < row; k += width) {
              if (k > 0) text += ", ";
              putTuple(&values[i * row + k], width, text);
            }
            text += i + 1 == count ? "\n" : ",\n";
          }
        }
      });
      for (size_t b = 0; b < used; ++b) sink_(blocks[b]);
      done_ += static_cast<double>(rows * row);
      advance(progress_, done_ / whole_, kStage);
    }
    sink_("    ]\n");
  }

  const SplatCloud& cloud_;
  Sink sink_;
  Progress* progress_;
  double done_ = 0, whole_;
};

}  // namespace

void writeUsdSplats(const SplatCloud& cloud, const std::string& path, const SplatWriteOptions&,
                    Progress* progress) {
  if (cloud.size() == 0) {
    fail(ErrorCode::kUnsupported, path +
                                      " cannot be written: the cloud is empty, and a prim of "
                                      "splats needs at least one");
  }
  OutputFile file(path);
  if (lowerExtension(path) != ".usdz") {
    LayerWriter(
        cloud, [&](const std::string& text) { file.write(text.data(), text.size()); }, progress)
        .write();
  } else {
    std::vector<uint8_t> layer;
    LayerWriter(
        cloud,
        [&](const std::string& text) { layer.insert(layer.end(), text.begin(), text.end()); },
        progress)
        .write();
    ZipWriter package(file, kPackageAlignment);
    package.add("splats.usda", layer);
    package.finish();
  }
  file.commit();
}

double estimateUsdSplats(uint64_t count, int degree, const SplatWriteOptions&) {
  return static_cast<double>(count) * kBytesOfNumber * (14 + higherHarmonics(degree));
}

}  // namespace stipple
