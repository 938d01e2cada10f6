#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/clouds/splat_frame.h"

namespace stipple {

/// In which space splat colours were made and must be composited.
enum class ColourSpace : uint32_t {
  kDisplay = 0,  ///< srgb_rec709_display: as trained splats are; composited in display space
  kLinear = 1,   ///< lin_rec709_display: scene linear Rec.709
};

/// Which low-pass filter the splats were made for.
enum class Antialias : uint32_t { kClassic = 0, kMip = 1 };

constexpr int kMaxShDegree = 4;

/// Y_0^0: colour = kShC0 * dc + 0.5.
constexpr float kShC0 = 0.28209479177387814f;

inline size_t shCoefficientCount(int degree) {
  return static_cast<size_t>(degree + 1) * static_cast<size_t>(degree + 1);
}

/// Splats as a structure of arrays, float32. Activated values: no logarithms, no logits.
struct SplatCloud {
  std::vector<float> positions;  ///< [N,3] metres
  std::vector<float> rotations;  ///< [N,4] w,x,y,z, unit
  std::vector<float> scales;     ///< [N,3] linear standard deviations, metres, >= 0
  std::vector<float> opacities;  ///< [N] 0..1
  std::vector<float> sh;         ///< [N,(degree+1)^2,3] coefficient-major, colour fastest, DC first
  int sh_degree = 0;             ///< 0..kMaxShDegree; 3DGS basis and signs
  ColourSpace colour_space = ColourSpace::kDisplay;
  Antialias antialias = Antialias::kClassic;
  Frame frame = Frame::kUnknown;  ///< which way the axes of the positions point

  size_t size() const { return opacities.size(); }
  size_t shStride() const { return shCoefficientCount(sh_degree) * 3; }
  void resize(size_t count);
};

/// Refuses clouds whose arrays disagree in size or hold values outside their range (non-finite
/// anywhere, negative scale, opacity outside 0..1, zero quaternion). `what` names the cloud.
void validate(const SplatCloud& cloud, const char* what);

/// Makes the quaternions of a cloud that validate() accepts of length one, in double.
void normaliseRotations(SplatCloud& cloud);

/// The part of validate() that reads no values: degree and array sizes.
void validateSizes(const SplatCloud& cloud, const char* what);

/// True where validate() finds nothing wrong with the values of splats [begin, end). In: a cloud
/// that validateSizes() accepts.
bool rowsAreValid(const SplatCloud& cloud, size_t begin, size_t end);

}  // namespace stipple
