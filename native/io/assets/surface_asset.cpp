#include "io/assets/surface_asset.h"

#include <cmath>
#include <string>

#include "base/error.h"
#include "io/assets/asset_header.h"
#include "io/bytes/safetensors.h"

namespace stipple {

namespace {

void requireRows(const std::string& what, size_t seen, size_t expected, ErrorCode code) {
  if (seen != expected) {
    fail(code, what + " has " + std::to_string(seen) + " rows; " + std::to_string(expected) +
                   " are needed");
  }
}

void requireNumbers(const std::string& what, const std::vector<float>& values, size_t width,
                    ErrorCode code) {
  for (size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) continue;
    fail(code, what + " holds " + std::to_string(values[i]) + " in row " +
                   std::to_string(i / width) + "; every value must be a finite number");
  }
}

/// Tangents of a normal of 1e37 are infinite. Shorter ones stand where a mesh has none.
void requireUnitNormals(const std::string& what, const std::vector<float>& normals,
                        ErrorCode code) {
  constexpr double kRounding = 1e-3;  // of float32, and of files that others have written
  for (size_t i = 0; i + 2 < normals.size(); i += 3) {
    const double length =
        std::hypot(static_cast<double>(normals[i]), static_cast<double>(normals[i + 1]),
                   static_cast<double>(normals[i + 2]));
    if (length <= 1 + kRounding) continue;
    fail(code, what + " has a length of " + std::to_string(length) + " in row " +
                   std::to_string(i / 3) + "; 1 is the most");
  }
}

void requireNoneNegative(const std::string& what, const std::vector<float>& values,
                         ErrorCode code) {
  for (size_t i = 0; i < values.size(); ++i) {
    if (values[i] >= 0) continue;
    fail(code, what + " holds " + std::to_string(values[i]) + " in row " + std::to_string(i) +
                   "; 0 is the least");
  }
}

/// Sizes that agree and numbers that are numbers, for an asset from either side.
void validateAsset(const SurfaceAsset& asset, const std::string& name, ErrorCode code) {
  validateOctree(asset, name, code);
  const PointSet& surface = asset.surface;
  const size_t count = surface.size();
  const auto check = [&](const char* part, const std::vector<float>& values, size_t width) {
    requireRows(name + ": surface." + part, values.size() / width, count, code);
    requireNumbers(name + ": surface." + part, values, width, code);
  };
  check("positions", surface.positions, 3);
  check("normals", surface.normals, 3);
  requireUnitNormals(name + ": surface.normals", surface.normals, code);
  check("colours", surface.colours, 3);
  check("opacities", surface.opacities, 1);
  check("areas", surface.areas, 1);
  check("weights", surface.weights, 1);
  if (surface.harmonic_degree > 0) {
    check("harmonics", surface.harmonics, surface.harmonicStride());
  }
  requireNoneNegative(name + ": surface.areas", surface.areas, code);
  requireNoneNegative(name + ": surface.weights", surface.weights, code);
}

/// Of any degree that sampleSurface gives; files without them have none.
void readHarmonics(const SafeTensorsReader& file, PointSet& surface) {
  const auto found = file.tensors().find("surface.harmonics");
  if (found == file.tensors().end()) return;
  const uint64_t width = found->second.shape.size() == 2 ? found->second.shape[1] : 0;
  for (int degree = 1; degree <= kMaxViewDegree; ++degree) {
    surface.harmonic_degree = degree;
    if (surface.harmonicStride() != width) continue;
    surface.harmonics = file.readFloats("surface.harmonics", width);
    return;
  }
  fail(ErrorCode::kFormat, file.path() + ": surface.harmonics has " + std::to_string(width) +
                               " numbers a sample; 9, 24 or 45 are allowed");
}

}  // namespace

void writeSurfaceAsset(const SurfaceAsset& asset, const std::string& path) {
  validateAsset(asset, "asset", ErrorCode::kInvalidArgument);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetSurface);
  file.setMetadata("colour_space", "lin_rec709_display");
  file.setMetadata("frame", "right-handed, z up, metres");
  file.setMetadata("settings", asset.settings_json);
  addOctree(file, asset);
  file.add("surface.positions", asset.surface.positions, 3);
  file.add("surface.normals", asset.surface.normals, 3);
  file.add("surface.colours", asset.surface.colours, 3);
  file.add("surface.opacities", asset.surface.opacities, 1);
  file.add("surface.areas", asset.surface.areas, 1);
  file.add("surface.weights", asset.surface.weights, 1);
  if (asset.surface.harmonic_degree > 0) {
    file.add("surface.harmonics", asset.surface.harmonics, asset.surface.harmonicStride());
  }
  addAssetExtras(file, asset.extras);
  file.write(path);
}

SurfaceAsset readSurfaceAsset(const std::string& path) {
  const SafeTensorsReader file(path);
  requireAssetKind(file, kAssetSurface);
  SurfaceAsset asset;
  static_cast<OctreeTensors&>(asset) = readOctree(file);
  asset.surface.positions = file.readFloats("surface.positions", 3);
  asset.surface.normals = file.readFloats("surface.normals", 3);
  asset.surface.colours = file.readFloats("surface.colours", 3);
  asset.surface.opacities = file.readFloats("surface.opacities", 1);
  asset.surface.areas = file.readFloats("surface.areas", 1);
  asset.surface.weights = file.readFloats("surface.weights", 1);
  readHarmonics(file, asset.surface);
  asset.settings_json = requireText(file, "settings");
  asset.extras = readAssetExtras(file);
  validateAsset(asset, path, ErrorCode::kFormat);
  return asset;
}

}  // namespace stipple
