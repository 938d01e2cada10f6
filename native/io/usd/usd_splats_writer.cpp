// Based on: OpenUSD 26.03, schema UsdVol (ParticleField3DGaussianSplat).
#include <string>

#include "base/error.h"
#include "io/usd/usd_file.h"
#include "io/usd/usd_layer_text.h"
#include "io/usd/usd_splats.h"

namespace stipple {

namespace {

constexpr char kStage[] = "Writing splats";
/// Of a number with what stands between it and the next, in scenes: measured.
constexpr double kBytesOfNumber = 12.5;
constexpr double kBytesOfHalf = 9.5;
constexpr double kPositionNumbers = 3;
constexpr double kOtherNumbers = 11;

}  // namespace

void writeUsdSplats(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress) {
  if (cloud.size() == 0) {
    fail(ErrorCode::kUnsupported, path +
                                      " cannot be written: the cloud is empty, and a prim of "
                                      "splats needs at least one");
  }
  if (options.half) requireHalves(cloud, path);
  UsdFile file(path);
  const UsdSink sink = [&](const std::string& text) { file.put(text); };
  const double whole = static_cast<double>(cloud.size() * (11 + cloud.shStride()));
  double done = 0;
  sink(usdLayerHead(cloud, "") + "    float3[] extent = " + usdExtent(cloud) + "\n");
  for (const UsdArray& array : usdArrays(cloud.sh_degree, options.half)) {
    sink(std::string("    ") + array.type + " " + array.name + " = [\n");
    putUsdRows(array, cloud, sink, [&](size_t rows) {
      done += static_cast<double>(rows * array.row);
      advance(progress, done / whole, kStage);
    });
    sink("    ]\n");
  }
  sink("}\n");
  file.commit();
}

double estimateUsdSplats(uint64_t count, int degree, const SplatWriteOptions& options) {
  const double others = kOtherNumbers + higherHarmonics(degree);
  return static_cast<double>(count) * (kPositionNumbers * kBytesOfNumber +
                                       others * (options.half ? kBytesOfHalf : kBytesOfNumber));
}

}  // namespace stipple
