#include "mesh/surface_colour.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace stipple {

namespace {

constexpr double kPlastic1 = 0.7548776662466927;  ///< 1/g, g^3 = g + 1
constexpr double kPlastic2 = 0.5698402909980532;  ///< 1/g^2
constexpr uint64_t kMaxTapCount = 8;
/// Weights of view directions around a direction are exp(s cos), with s this share of their number:
/// the nearest of M even directions is on average 1 / M of the sphere's height away.
constexpr float kViewSharpness = 1.0f;
constexpr float kLeastViewWeight = 0.02f;  ///< of the nearest direction's

}  // namespace

SurfaceColour::SurfaceColour(const TriMesh& mesh) : mesh_(mesh) {
  for (const Image& image : mesh.textures) textures_.emplace_back(image);
  view_sharpness_ = kViewSharpness * static_cast<float>(mesh.view_directions.size() / 3);
}

bool SurfaceColour::changesWithView(size_t triangle) const {
  return !materialOf(triangle).view_textures.empty();
}

void SurfaceColour::addedByViews(size_t triangle, const Barycentric& place,
                                 std::span<float> added) const {
  const std::vector<uint32_t>& views = materialOf(triangle).view_textures;
  for (size_t i = 0; i < views.size(); ++i) {
    const std::array<float, 4> value = lookUp(textures_[views[i]], triangle, place);
    std::copy(value.begin(), value.begin() + 3, added.begin() + static_cast<std::ptrdiff_t>(i * 3));
  }
}

std::array<float, 4> SurfaceColour::seenAlong(const std::array<float, 3>& direction,
                                              size_t triangle, const Barycentric& place) const {
  std::array<float, 4> colour = at(triangle, place, 0.0, 0);
  const std::vector<uint32_t>& views = materialOf(triangle).view_textures;
  if (views.empty()) return colour;
  const auto cosineOf = [&](size_t i) {
    const float* d = &mesh_.view_directions[i * 3];
    return d[0] * direction[0] + d[1] * direction[1] + d[2] * direction[2];
  };
  float nearest = -1;
  for (size_t i = 0; i < views.size(); ++i) nearest = std::max(nearest, cosineOf(i));
  float sum = 0;
  std::array<float, 3> added = {0, 0, 0};
  for (size_t i = 0; i < views.size(); ++i) {
    const float weight = std::exp(view_sharpness_ * (cosineOf(i) - nearest));
    if (weight < kLeastViewWeight) continue;
    const std::array<float, 4> value = lookUp(textures_[views[i]], triangle, place);
    for (size_t c = 0; c < 3; ++c) added[c] += weight * value[c];
    sum += weight;
  }
  for (size_t c = 0; c < 3; ++c) colour[c] = std::max(0.0f, colour[c] + added[c] / sum);
  return colour;
}

const Material& SurfaceColour::materialOf(size_t triangle) const {
  return mesh_.materials[mesh_.triangle_materials.empty() ? 0 : mesh_.triangle_materials[triangle]];
}

bool SurfaceColour::mayBeTransparent(size_t triangle) const {
  const Material& material = materialOf(triangle);
  if (material.colour == MaterialColour::kTexture) {
    return mesh_.textures[material.texture].channels == 4;
  }
  return material.colour == MaterialColour::kCorner || material.base_colour[3] < 1;
}

std::array<float, 4> SurfaceColour::at(size_t triangle, const Barycentric& place, double share,
                                       uint64_t random) const {
  const Material& material = materialOf(triangle);
  std::array<float, 4> colour = {material.base_colour[0], material.base_colour[1],
                                 material.base_colour[2], material.base_colour[3]};
  if (material.colour == MaterialColour::kTexture) {
    colour = textured(textures_[material.texture], triangle, place, std::min(1.0, share), random);
  } else if (material.colour == MaterialColour::kCorner) {
    colour = interpolated(triangle, place);
  }
  colour[3] = std::clamp(colour[3], 0.0f, 1.0f);
  return colour;
}

std::array<float, 4> SurfaceColour::interpolated(size_t triangle, const Barycentric& place) const {
  std::array<float, 4> colour = {0, 0, 0, 0};
  for (size_t corner = 0; corner < 3; ++corner) {
    for (size_t c = 0; c < 4; ++c) {
      colour[c] +=
          static_cast<float>(place[corner]) * mesh_.corner_colours[triangle * 12 + corner * 4 + c];
    }
  }
  return colour;
}

std::array<float, 4> SurfaceColour::lookUp(const TextureLookup& texture, size_t triangle,
                                           const Barycentric& place) const {
  const float* uv = &mesh_.corner_uvs[triangle * 6];
  float u = 0, v = 0;
  for (size_t corner = 0; corner < 3; ++corner) {
    u += static_cast<float>(place[corner]) * uv[corner * 2];
    v += static_cast<float>(place[corner]) * uv[corner * 2 + 1];
  }
  return texture.at(u, v);
}

/// Mean over the piece of the triangle that the sample stands for: one tap per two texels, at
/// most eight, so that a fine texture does not alias into speckles.
std::array<float, 4> SurfaceColour::textured(const TextureLookup& texture, size_t triangle,
                                             const Barycentric& place, double share,
                                             uint64_t random) const {
  const float* uv = &mesh_.corner_uvs[triangle * 6];
  const double du[2] = {static_cast<double>(uv[2] - uv[0]), static_cast<double>(uv[4] - uv[0])};
  const double dv[2] = {static_cast<double>(uv[3] - uv[1]), static_cast<double>(uv[5] - uv[1])};
  const double texels =
      0.5 * std::abs(du[0] * dv[1] - du[1] * dv[0]) * texture.width() * texture.height() * share;
  const auto taps = static_cast<uint64_t>(
      std::clamp(std::ceil(texels / 2), 1.0, static_cast<double>(kMaxTapCount)));
  if (taps == 1) return lookUp(texture, triangle, place);
  // Side of the sample's square where the triangle is the lower half of the unit square.
  const double side = std::sqrt(0.5 * share);
  const double start[2] = {unitDouble(mixBits(random)), unitDouble(mixBits(~random))};
  std::array<double, 4> sum = {0, 0, 0, 0};
  for (uint64_t tap = 0; tap < taps; ++tap) {
    double x = start[0] + kPlastic1 * static_cast<double>(tap);
    double y = start[1] + kPlastic2 * static_cast<double>(tap);
    x = place[1] + (x - std::floor(x) - 0.5) * side;
    y = place[2] + (y - std::floor(y) - 0.5) * side;
    Barycentric at = {std::max(0.0, 1 - x - y), std::max(0.0, x), std::max(0.0, y)};
    const double total = at[0] + at[1] + at[2];
    for (double& weight : at) weight /= total;
    const std::array<float, 4> colour = lookUp(texture, triangle, at);
    // Colour weighted by alpha: transparent texels do not bleed theirs.
    for (size_t c = 0; c < 3; ++c) sum[c] += static_cast<double>(colour[c] * colour[3]);
    sum[3] += static_cast<double>(colour[3]);
  }
  if (sum[3] <= 0) {
    std::array<float, 4> colour = lookUp(texture, triangle, place);
    colour[3] = 0;
    return colour;
  }
  return {static_cast<float>(sum[0] / sum[3]), static_cast<float>(sum[1] / sum[3]),
          static_cast<float>(sum[2] / sum[3]),
          static_cast<float>(sum[3] / static_cast<double>(taps))};
}

}  // namespace stipple
