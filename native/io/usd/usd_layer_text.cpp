// Based on: OpenUSD 26.03, schema UsdVol (ParticleField3DGaussianSplat).
#include "io/usd/usd_layer_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "io/usd/usd_names.h"
#include "math/half_float.h"

namespace stipple {

namespace {

constexpr size_t kBlockRows = 4096;
constexpr size_t kBlocksAtOnce = 32;
constexpr double kReach = 3.0;  ///< standard deviations that the extent holds

void putNumber(float value, bool is_half, std::string& text) {
  constexpr int kDigitsOfHalf = 5;  // tell any two numbers of half precision apart
  char digits[32];
  char* const end = digits + sizeof(digits);
  // In single precision the shortest decimal that reads back as the same number.
  const auto written = is_half ? std::to_chars(digits, end, halfToFloat(floatToHalf(value)),
                                               std::chars_format::general, kDigitsOfHalf)
                               : std::to_chars(digits, end, value);
  text.append(digits, written.ptr);
}

/// "(a, b, c)", or "a" alone.
void putTuple(const float* values, size_t width, bool is_half, std::string& text) {
  if (width > 1) text += '(';
  for (size_t k = 0; k < width; ++k) {
    if (k > 0) text += ", ";
    putNumber(values[k], is_half, text);
  }
  if (width > 1) text += ')';
}

void addCustom(const std::string& key, const std::string& value, std::string& custom) {
  custom += "            string " + key + " = \"" + value + "\"\n";
}

}  // namespace

std::array<UsdArray, 5> usdArrays(int sh_degree, bool halves) {
  const size_t harmonics = shCoefficientCount(sh_degree) * 3;
  if (halves) {
    return {{{"point3f[]", kUsdPositions, &SplatCloud::positions, 3, 3, false},
             {"quath[]", kUsdOrientationsHalf, &SplatCloud::rotations, 4, 4, true},
             {"half3[]", kUsdScalesHalf, &SplatCloud::scales, 3, 3, true},
             {"half[]", kUsdOpacitiesHalf, &SplatCloud::opacities, 1, 1, true},
             {"half3[]", kUsdCoefficientsHalf, &SplatCloud::sh, 3, harmonics, true}}};
  }
  return {{{"point3f[]", kUsdPositions, &SplatCloud::positions, 3, 3, false},
           {"quatf[]", kUsdOrientations, &SplatCloud::rotations, 4, 4, false},
           {"float3[]", kUsdScales, &SplatCloud::scales, 3, 3, false},
           {"float[]", kUsdOpacities, &SplatCloud::opacities, 1, 1, false},
           {"float3[]", kUsdCoefficients, &SplatCloud::sh, 3, harmonics, false}}};
}

void requireHalves(const SplatCloud& cloud, const std::string& path) {
  constexpr float kLargestHalf = 65504.0f;
  for (const std::vector<float>* values : {&cloud.scales, &cloud.sh}) {
    const auto found = std::find_if(values->begin(), values->end(),
                                    [](float value) { return std::abs(value) > kLargestHalf; });
    if (found == values->end()) continue;
    fail(ErrorCode::kUnsupported, path + " cannot be written in half precision: a splat has " +
                                      numberText(static_cast<double>(*found)) +
                                      ", and half precision reaches 65504");
  }
}

std::string usdMetadata(Frame frame, const std::string& prim, const std::string& times) {
  return "#usda 1.0\n(\n    defaultPrim = \"" + prim +
         "\"\n    doc = \"Written by Stipple\"\n    metersPerUnit = 1\n" + times +
         "    upAxis = \"" + (frame == kUsdFrameOfZUp ? "Z" : "Y") + "\"\n)\n";
}

std::string usdLayerHead(const SplatCloud& like, const std::string& times) {
  return usdMetadata(like.frame, "Splats", times) + "\n" + usdPrimHead(like, "Splats");
}

std::string usdPrimHead(const SplatCloud& like, const std::string& name) {
  std::string text = "def " + std::string(kUsdSplats) + " \"" + name + "\"";
  std::string custom;
  if (like.antialias == Antialias::kMip) addCustom(kUsdAntialiasKey, kUsdMip, custom);
  if (like.frame != kUsdFrame && like.frame != kUsdFrameOfZUp) {
    addCustom(kUsdFrameKey, frameName(like.frame), custom);
  }
  const bool is_linear = like.colour_space == ColourSpace::kLinear;
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
  return text + "    uniform int " + std::string(kUsdDegree) + " = " +
         std::to_string(like.sh_degree) + "\n";
}

std::string usdExtent(const SplatCloud& cloud) {
  if (cloud.size() == 0) return "[(0, 0, 0), (0, 0, 0)]";
  std::array<double, 3> low, high;
  low.fill(HUGE_VAL);
  high.fill(-HUGE_VAL);
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float* scales = &cloud.scales[i * 3];
    const double reach = kReach * static_cast<double>(std::max({scales[0], scales[1], scales[2]}));
    for (size_t axis = 0; axis < 3; ++axis) {
      const double place = static_cast<double>(cloud.positions[i * 3 + axis]);
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
    putTuple(values.data(), 3, false, text);
  }
  return text + "]";
}

void putUsdRows(const UsdArray& array, const SplatCloud& cloud, const UsdSink& sink,
                const std::function<void(size_t rows)>& written) {
  const std::vector<float>& values = cloud.*array.values;
  const size_t count = cloud.size();
  std::vector<std::string> blocks(kBlocksAtOnce);
  for (size_t first = 0; first < count; first += kBlockRows * kBlocksAtOnce) {
    const size_t rows = std::min(kBlockRows * kBlocksAtOnce, count - first);
    const size_t used = (rows + kBlockRows - 1) / kBlockRows;
    parallelFor(used, 1, [&](size_t begin, size_t end) {
      for (size_t b = begin; b < end; ++b) {
        std::string& text = blocks[b];
        text.clear();
        const size_t from = first + b * kBlockRows;
        for (size_t i = from; i < std::min(from + kBlockRows, count); ++i) {
          for (size_t k = 0; k < array.row; k += array.width) {
            if (k > 0) text += ", ";
            putTuple(&values[i * array.row + k], array.width, array.is_half, text);
          }
          text += i + 1 == count ? "\n" : ",\n";
        }
      }
    });
    for (size_t b = 0; b < used; ++b) sink(blocks[b]);
    written(rows);
  }
}

}  // namespace stipple
