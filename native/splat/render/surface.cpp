#include "splat/render/surface.h"

#include <bit>
#include <string>

#include "base/error.h"

namespace stipple {

namespace {

std::string nameOf(const char* array, const SurfaceLayer& surface, size_t pixel) {
  return std::string("the surface's ") + array + " at pixel (" +
         std::to_string(pixel % surface.width) + ", " + std::to_string(pixel / surface.width) +
         ") is ";
}

/// By bits: comparing NaN would raise a trap.
bool isDepth(float depth) {
  constexpr uint32_t kInfinity = 0x7f800000u, kSign = 0x80000000u;
  const uint32_t bits = std::bit_cast<uint32_t>(depth);
  return (bits & ~kSign) <= kInfinity && bits != (kInfinity | kSign);
}

void requireOpacity(const char* array, const SurfaceLayer& surface, size_t pixel, float opacity) {
  // NaN and everything above 1 have larger bits than 1, the negative ones too.
  if (std::bit_cast<uint32_t>(opacity + 0.0f) <= std::bit_cast<uint32_t>(1.0f)) return;
  fail(ErrorCode::kInvalidArgument,
       nameOf(array, surface, pixel) + std::to_string(opacity) + "; 0 to 1 is allowed");
}

}  // namespace

void validateSurface(const SurfaceLayer& surface, const Camera& camera) {
  if (!surface.depth) {
    if (surface.colour || surface.matte_opacity) {
      fail(ErrorCode::kInvalidArgument,
           "the surface has a colour or an opacity and no depth; it needs a depth");
    }
    return;
  }
  if (surface.width != camera.width || surface.height != camera.height) {
    fail(ErrorCode::kInvalidArgument,
         "the surface is " + std::to_string(surface.width) + " x " +
             std::to_string(surface.height) + " pixels; it must have the image's " +
             std::to_string(camera.width) + " x " + std::to_string(camera.height));
  }
  const size_t count = static_cast<size_t>(surface.width) * surface.height;
  for (size_t i = 0; i < count; ++i) {
    if (!isDepth(surface.depth[i])) {
      fail(ErrorCode::kInvalidArgument, nameOf("depth", surface, i) +
                                            std::to_string(surface.depth[i]) +
                                            "; metres are allowed, or 1e10 and more for nothing");
    }
  }
  if (surface.matte_opacity) {
    for (size_t i = 0; i < count; ++i) {
      requireOpacity("matte opacity", surface, i, surface.matte_opacity[i]);
    }
  }
  if (!surface.colour) return;
  requireFinite(surface.colour, count * 4, 4, "the surface's colour at pixel");
  for (size_t i = 0; i < count; ++i) {
    const float alpha = surface.colour[i * 4 + 3];
    requireOpacity("alpha", surface, i, alpha);
    if (surface.matte_opacity && surface.matte_opacity[i] < alpha) {
      fail(ErrorCode::kInvalidArgument,
           nameOf("matte opacity", surface, i) + std::to_string(surface.matte_opacity[i]) +
               "; no less than its alpha, " + std::to_string(alpha) + ", is allowed");
    }
  }
}

}  // namespace stipple
