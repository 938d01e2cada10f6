#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Our own keys of meta.json, written where a scene is not as all others are.
constexpr char kSogColourSpaceKey[] = "stipple_colour_space";
constexpr char kSogFrameKey[] = "stipple_frame";

/// What the meta.json of a SOG scene says, both versions in one form: tables from a byte of a
/// picture to the value it stands for.
struct SogMeta {
  using Table = std::array<float, 256>;

  uint64_t count = 0;
  Antialias antialias = Antialias::kClassic;
  ColourSpace colour_space = ColourSpace::kDisplay;
  Frame frame = Frame::kRDF;
  bool flat = false;  ///< 2DGS: the third scale means nothing

  /// Positions in log space, sign(x) ln(1 + |x|).
  std::array<double, 3> means_min{};
  std::array<double, 3> means_max{};
  std::array<Table, 3> scales{};   ///< linear standard deviations, per axis
  std::array<Table, 3> colours{};  ///< harmonic coefficient 0, per channel
  Table opacities{};               ///< 0..1
  uint64_t palette_count = 0;      ///< vectors in the palette of harmonics
  int bands = 0;                   ///< 1..3, 0: not told or no harmonics
  Table harmonics{};

  /// Plain file names beside meta.json; the last two are empty without harmonics.
  std::string means_low, means_high, scales_file, rotations_file, colours_file;
  std::string centroids_file, labels_file;

  bool hasHarmonics() const { return !centroids_file.empty(); }
};

/// In: text, the JSON; name, what messages call it.
/// Errors: kFormat with the key, the value seen and the value allowed; kUnsupported (version).
SogMeta parseSogMeta(const std::string& text, const std::string& name);

}  // namespace stipple
