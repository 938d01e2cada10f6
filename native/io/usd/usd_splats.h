#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/splats/splat_format.h"

namespace stipple {

/// True for USD layers, those of the binary kind included, which readUsdSplats() refuses by name.
bool startsAsUsd(const SplatFileStart& start);
/// True for zip archives that are named .usdz.
bool startsAsUsdz(const SplatFileStart& start);

/// Reads the prims of type ParticleField3DGaussianSplat that a layer of text (.usda, .usd) or a
/// package with such a layer (.usdz) draws, placed by their transformations, as one cloud; splats
/// of a lower degree than others get zeros. Arrays at several times give those of the first.
/// Errors: kIo, kFormat (file, line or prim, attribute), kUnsupported (binary layers, references
/// that leave the file's folder).
SplatCloud readUsdSplats(const std::string& path, Progress* progress);

/// The same at every time of a file. It is open, with all of its numbers in memory, as long as
/// this lives.
class UsdSplatsReader {
 public:
  /// Errors: kIo, kFormat, kUnsupported.
  explicit UsdSplatsReader(const std::string& path);
  ~UsdSplatsReader();
  UsdSplatsReader(const UsdSplatsReader&) = delete;
  UsdSplatsReader& operator=(const UsdSplatsReader&) = delete;

  /// Time codes at which splats, or what they lie in, have values, ascending; none for a file that
  /// stands still.
  const std::vector<double>& times() const { return times_; }
  /// Time codes in a second, which a file that does not say it has 24 of. Above 0.
  double framesPerSecond() const;
  /// What is drawn at a time, which may be nothing: an attribute has the last of its values up to
  /// there, or its first. Errors: as of readUsdSplats().
  SplatCloud at(double time);
  /// What readUsdSplats() gives.
  SplatCloud still(Progress* progress);

 private:
  struct Open;
  std::unique_ptr<Open> open_;
  std::vector<double> times_;
};

/// Writes a layer of text with one prim, or a package with it. Errors: kUnsupported for a cloud
/// without splats, and for packages above 4 GiB.
void writeUsdSplats(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress);
double estimateUsdSplats(uint64_t count, int degree, const SplatWriteOptions& options);

}  // namespace stipple
