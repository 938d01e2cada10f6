#include "splat/voxels/voxelize_splat.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "math/colour.h"
#include "math/covariance.h"
#include "math/principal_axes.h"
#include "splat/voxels/voxelize_polylog.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;
constexpr double kBoundsSigma = 4.0;     // extent of a splat in the bounds without a cut-off
constexpr double kMinVoxelSize = 1e-12;  // metres; keeps every product inside float
constexpr double kMaxVoxelSize = 1e12;   // metres
constexpr double kMaxVoxelIndex = 2147483632.0;  // 2^31 - 16: a brick further still fits int32
// Thinnest axis, in voxels, that is evaluated as it is. Below, the extinction overflows or is a
// spike that no voxel meets.
constexpr double kMinAxis = 1e-9;
// exp(-86) is the last power that stays a normal float after the products of the kernel.
constexpr double kMaxExponent = 86.0;
constexpr double kMaxSigma = 13.12;  // sqrt(2 * 86): no splat reaches further

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

void checkOptions(const VoxelizeOptions& options) {
  requireFinite(options.voxel_size, "voxel size");
  requireFinite(options.low_pass, "low_pass");
  requireFinite(options.cut_off_sigma, "cut_off_sigma");
  requireFinite(options.min_density, "min_density");
  if (options.voxel_size < 0 || (options.voxel_size == 0 && options.resolution == 0)) {
    refuse("voxel size is " + numberText(options.voxel_size) + " m and resolution " +
           std::to_string(options.resolution) +
           "; a positive voxel size, or 0 with a resolution of at least 1, is allowed");
  }
  if (options.low_pass < 0 || options.low_pass > 16) {
    refuse("low_pass is " + numberText(options.low_pass) + "; 0 to 16 voxels is allowed");
  }
  if (options.min_density < 0) {
    refuse("min_density is " + numberText(options.min_density) +
           " per metre; 0 or more is allowed");
  }
}

void checkInstances(std::span<const SplatInstance> instances) {
  size_t count = 0;
  std::vector<const SplatCloud*> checked;
  for (size_t i = 0; i < instances.size(); ++i) {
    const SplatInstance& instance = instances[i];
    const std::string name = "instance " + std::to_string(i);
    if (!instance.cloud) refuse(name + " has no cloud");
    validateAffine(instance.object_to_world, (name + ": the matrix").c_str());
    validate(instance.grade, name.c_str());
    if (std::find(checked.begin(), checked.end(), instance.cloud) == checked.end()) {
      validate(*instance.cloud, name.c_str());
      checked.push_back(instance.cloud);
    }
    count += instance.cloud->size();
  }
  if (count == 0) {
    refuse("nothing to voxelize: " + std::to_string(instances.size()) +
           " instances hold 0 splats; at least one splat is needed");
  }
  if (count > std::numeric_limits<uint32_t>::max()) {
    refuse("voxelize: " + std::to_string(count) + " splats; at most 4294967295 are allowed");
  }
}

// Columns: the scaled axes of a splat in the world. Their outer product is the covariance.
Mat3d worldAxes(const SplatInstance& instance, size_t i) {
  const SplatCloud& cloud = *instance.cloud;
  return linearPart(instance.object_to_world) *
         scaledAxes<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]);
}

Vec3d worldCentre(const SplatInstance& instance, size_t i) {
  const float* p = &instance.cloud->positions[i * 3];
  const Vec3d local(p[0], p[1], p[2]);
  return linearPart(instance.object_to_world) * local + translationPart(instance.object_to_world);
}

struct SplatAxes {
  Mat3d directions;  // columns, orthonormal, by growing length
  Vec3d lengths;     // standard deviations
};

// From A itself, not from the covariance A A^T: the product would lose the thin axes of needles
// (1e6 : 1 squares to 1e12).
SplatAxes axesByLength(const Mat3d& a) {
  const PrincipalAxes found = principalAxes(a);
  std::array<int, 3> order = {0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](int x, int y) { return found.lengths[x] < found.lengths[y]; });
  SplatAxes result;
  for (int i = 0; i < 3; ++i) {
    result.directions.col(i) = found.axes.col(order[static_cast<size_t>(i)]);
    result.lengths[i] = found.lengths[order[static_cast<size_t>(i)]];
  }
  return result;
}

// How many samples per voxel keep the sum over voxels near the integral. The profile of a splat has
// a core of half width l sqrt(-2 ln o), from the square-root branch point of Li_1/2; once the
// thinnest axis is averaged the next one only meets the logarithm of it, and the last one less
// still. With the spacings below the mass of a splat of half a voxel and o = 0.99 strays by 0.2 %
// where it is flat and wide, and by 5 % where it is round (one sample: 16 % and 73 %).
void chooseSamples(VoxelSplat& splat, const Vec3d& lengths, double minus_log_opacity) {
  constexpr double kPerAxis[3] = {0.4, 0.2, 0.1};
  // A faint splat is a plain Gaussian without a core; a spacing of 1.9 standard deviations does.
  const double core = std::min(0.75, std::sqrt(2.0 * minus_log_opacity));
  for (int axis = 0; axis < 3; ++axis) {
    const double wanted = std::ceil(kPerAxis[axis] / (lengths[axis] * core));
    const double allowed = kVoxelMaxSamples[axis];
    splat.samples[axis] = static_cast<uint8_t>(std::clamp(wanted, 1.0, allowed));
  }
}

void readColour(const SplatInstance& instance, size_t i, float colour[3]) {
  const SplatCloud& cloud = *instance.cloud;
  const float* dc = &cloud.sh[i * cloud.shStride()];
  for (int channel = 0; channel < 3; ++channel) colour[channel] = 0.5f + kShC0 * dc[channel];
  if (instance.grade.changesColour()) applyGrade(instance.grade, colour);
  for (int channel = 0; channel < 3; ++channel) {
    const float value = std::clamp(colour[channel], 0.0f, 1e12f);
    colour[channel] = cloud.colour_space == ColourSpace::kDisplay ? srgbToLinear(value) : value;
  }
}

// Returns false where the splat contributes nothing.
bool prepareSplat(const SplatInstance& instance, size_t i, const VoxelizeOptions& options,
                  double voxel_size, VoxelSplat& splat) {
  const SplatCloud& cloud = *instance.cloud;
  double opacity = static_cast<double>(cloud.opacities[i]) * instance.grade.opacity;
  opacity = std::min(kVoxelMaxOpacity, opacity);
  if (opacity <= 0) return false;
  const Mat3d axes = worldAxes(instance, i) / voxel_size;
  splat.centre = worldCentre(instance, i) / voxel_size;
  if (!axes.allFinite() || !splat.centre.allFinite()) {
    refuse("splat " + std::to_string(i) +
           " is not finite once its instance's matrix is applied; smaller values are needed");
  }
  SplatAxes principal = axesByLength(axes);
  if (options.low_pass > 0) {
    const Vec3d widened = principal.lengths.cwiseMax(options.low_pass);
    opacity *= principal.lengths[1] / widened[1] * (principal.lengths[2] / widened[2]);
    principal.lengths = widened;
    if (opacity <= 0) return false;
  }
  if (principal.lengths[0] < kMinAxis) {
    refuse("splat " + std::to_string(i) + " is " + numberText(principal.lengths[0] * voxel_size) +
           " m thin, so its extinction has no finite value at a voxel size of " +
           numberText(voxel_size) + " m; a larger low_pass, or an axis of at least " +
           numberText(kMinAxis * voxel_size) + " m, is needed");
  }

  const double minus_log_opacity = -std::log(opacity);
  const double amplitude =
      1.0 / (std::sqrt(2.0 * std::numbers::pi) * principal.lengths[0] * voxel_size);
  // The floor is what rounding to float takes from the smallest density that is stored.
  double exponent = kMaxExponent;
  if (options.min_density > 0) {
    exponent = std::min(
        exponent, std::log(amplitude) - std::log(options.min_density) + 24.0 * std::numbers::ln2);
  }
  if (!(exponent > minus_log_opacity)) return false;
  splat.reach = std::sqrt(2.0 * (exponent - minus_log_opacity));
  if (options.cut_off_sigma > 0) splat.reach = std::min(splat.reach, options.cut_off_sigma);
  splat.minus_log_opacity = static_cast<float>(minus_log_opacity);
  splat.amplitude = static_cast<float>(amplitude);
  readColour(instance, i, splat.colour);
  chooseSamples(splat, principal.lengths, minus_log_opacity);
  Vec3d sample_extent = Vec3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    splat.to_unit.row(axis) = principal.directions.col(axis).transpose() / principal.lengths[axis];
    const double count = splat.samples[axis];
    sample_extent += principal.directions.col(axis).cwiseAbs() * (0.5 * (count - 1.0) / count);
  }
  const Mat3d scaled = principal.directions * principal.lengths.asDiagonal();
  splat.half_extent = scaled.rowwise().norm() * splat.reach + sample_extent;

  const double furthest = (splat.centre.cwiseAbs() + splat.half_extent).maxCoeff();
  if (furthest > kMaxVoxelIndex) {
    refuse("voxel size " + numberText(voxel_size) + " m puts splat " + std::to_string(i) +
           " at voxel index " + numberText(furthest) + "; at most " + numberText(kMaxVoxelIndex) +
           " is allowed, a voxel size of at least " +
           numberText(voxel_size * furthest / kMaxVoxelIndex) + " m");
  }
  return true;
}

}  // namespace

double chooseVoxelSize(std::span<const SplatInstance> instances, const VoxelizeOptions& options) {
  checkOptions(options);
  checkInstances(instances);
  double voxel_size = options.voxel_size;
  if (voxel_size == 0) {
    const double sigma =
        options.cut_off_sigma > 0 ? std::min(options.cut_off_sigma, kMaxSigma) : kBoundsSigma;
    Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity());
    Vec3d high = -low;
    for (const SplatInstance& instance : instances) {
      const SplatCloud& cloud = *instance.cloud;
      std::vector<Vec3d> lows(rangeCount(cloud.size(), kGrain), low);
      std::vector<Vec3d> highs(lows.size(), high);
      parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
        Vec3d& range_low = lows[begin / kGrain];
        Vec3d& range_high = highs[begin / kGrain];
        for (size_t i = begin; i < end; ++i) {
          if (cloud.opacities[i] <= 0 || instance.grade.opacity <= 0) continue;
          const Vec3d extent = worldAxes(instance, i).rowwise().norm() * sigma;
          const Vec3d centre = worldCentre(instance, i);
          range_low = range_low.cwiseMin(centre - extent);
          range_high = range_high.cwiseMax(centre + extent);
        }
      });
      for (const Vec3d& value : lows) low = low.cwiseMin(value);
      for (const Vec3d& value : highs) high = high.cwiseMax(value);
    }
    const double side = (high - low).maxCoeff();
    if (!(side > 0) || !std::isfinite(side)) {
      refuse("the splats' bounds are " + numberText(std::max(side, 0.0)) +
             " m long, which gives no voxel size; set a voxel size above 0");
    }
    voxel_size = side / options.resolution;
  }
  if (voxel_size < kMinVoxelSize || voxel_size > kMaxVoxelSize) {
    refuse("voxel size is " + numberText(voxel_size) + " m; " + numberText(kMinVoxelSize) + " to " +
           numberText(kMaxVoxelSize) + " m is allowed");
  }
  return voxel_size;
}

std::vector<VoxelSplat> prepareVoxelSplats(std::span<const SplatInstance> instances,
                                           const VoxelizeOptions& options, double voxel_size,
                                           Progress* progress) {
  size_t total = 0;
  for (const SplatInstance& instance : instances) total += instance.cloud->size();
  std::vector<VoxelSplat> splats(total);
  std::vector<uint8_t> kept(total, 0);
  size_t first = 0;
  for (const SplatInstance& instance : instances) {
    parallelFor(instance.cloud->size(), kGrain, [&](size_t begin, size_t end) {
      if (progress) progress->throwIfCancelled();
      for (size_t i = begin; i < end; ++i) {
        kept[first + i] = prepareSplat(instance, i, options, voxel_size, splats[first + i]);
      }
    });
    first += instance.cloud->size();
  }
  size_t count = 0;
  for (size_t i = 0; i < total; ++i) {
    if (kept[i]) splats[count++] = splats[i];
  }
  splats.resize(count);
  return splats;
}

}  // namespace stipple
