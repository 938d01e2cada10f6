#include "data/clouds/splat_frame.h"

#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "data/clouds/splat_cloud.h"
#include "math/spherical_harmonics.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;
constexpr const char* kNames[kLastFrame + 1] = {"unknown", "LDB", "RDB", "LUB", "RUB", "LDF",
                                                "RDF",     "LUF", "RUF", "LFD", "RFD", "LFU",
                                                "RFU",     "LBD", "RBD", "LBU", "RBU"};

/// A direction of the world (0: right, 1: up, 2: back) and which way along it.
struct Direction {
  size_t axis;
  float sign;
};

Direction directionOf(char letter) {
  switch (letter) {
    case 'R':
      return {0, 1.0f};
    case 'L':
      return {0, -1.0f};
    case 'U':
      return {1, 1.0f};
    case 'D':
      return {1, -1.0f};
    case 'B':
      return {2, 1.0f};
    default:
      return {2, -1.0f};
  }
}

/// How Y_lm changes where axis i is mirrored for sign[i] < 0. Its factors are a polynomial in z of
/// the parity of l + m, and for m >= 0 the real part of (x + iy)^m, for m < 0 the imaginary part of
/// (x + iy)^|m|: y stands in the one to even, in the other to odd powers, x to what is left of m.
float harmonicSign(int l, int m, const std::array<float, 3>& sign) {
  const int order = std::abs(m);
  float factor = 1.0f;
  if (sign[2] < 0 && (l + order) % 2 != 0) factor = -factor;
  if (sign[1] < 0 && m < 0) factor = -factor;
  if (sign[0] < 0 && (order + (m < 0 ? 1 : 0)) % 2 != 0) factor = -factor;
  return factor;
}

int permutationSign(const std::array<size_t, 3>& p) {
  int sign = 1;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = i + 1; j < 3; ++j) sign = p[i] > p[j] ? -sign : sign;
  }
  return sign;
}

}  // namespace

const char* frameName(Frame frame) {
  return kNames[static_cast<uint32_t>(frame)];
}

std::optional<Frame> frameFromName(const std::string& name) {
  for (uint32_t i = 0; i <= kLastFrame; ++i) {
    if (name == kNames[i]) return static_cast<Frame>(i);
  }
  return std::nullopt;
}

FrameConversion::FrameConversion(Frame from, Frame to) {
  harmonic_sign_.fill(1.0f);
  if (from == Frame::kUnknown) from = kConventionalFrame;
  if (to == Frame::kUnknown) to = kConventionalFrame;
  if (from == to) return;
  identity_ = false;
  Mat3d matrix = Mat3d::Zero();
  float determinant = 1.0f;
  for (size_t i = 0; i < 3; ++i) {
    const Direction wanted = directionOf(frameName(to)[i]);
    for (size_t j = 0; j < 3; ++j) {
      const Direction given = directionOf(frameName(from)[j]);
      if (given.axis != wanted.axis) continue;
      source_[i] = j;
      sign_[i] = wanted.sign * given.sign;
      determinant *= sign_[i];
      matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          static_cast<double>(sign_[i]);
    }
    swaps_ = swaps_ || source_[i] != i;
  }
  turn_sign_ = determinant * static_cast<float>(permutationSign(source_));
  if (swaps_) {
    harmonics_ = std::make_unique<HarmonicRotation>(matrix);
    return;
  }
  size_t coefficient = 0;
  for (int l = 0; l <= kMaxShDegree; ++l) {
    for (int m = -l; m <= l; ++m) harmonic_sign_[coefficient++] = harmonicSign(l, m, sign_);
  }
}

FrameConversion::~FrameConversion() = default;

void FrameConversion::apply(float* position, float* rotation, float* scale, int degree,
                            float* sh) const {
  if (identity_) return;
  const float p[3] = {position[0], position[1], position[2]};
  const float s[3] = {scale[0], scale[1], scale[2]};
  const float v[3] = {rotation[1], rotation[2], rotation[3]};
  for (size_t i = 0; i < 3; ++i) {
    const size_t from = source_[i];
    position[i] = sign_[i] * p[from];
    // The local axes are renamed with the world's, M R M^T, so that the rotation stays a rotation.
    scale[i] = s[from];
    // A rotation's axis is a pseudovector: it turns over where the change mirrors.
    rotation[1 + i] = turn_sign_ * sign_[i] * v[from];
  }
  if (swaps_) {
    harmonics_->apply(degree, sh);
    return;
  }
  const size_t coefficients = shCoefficientCount(degree);
  for (size_t k = 1; k < coefficients; ++k) {
    for (size_t c = 0; c < 3; ++c) sh[k * 3 + c] *= harmonic_sign_[k];
  }
}

void convertFrame(SplatCloud& cloud, Frame to) {
  const FrameConversion conversion(cloud.frame, to);
  cloud.frame = to;
  if (conversion.isIdentity()) return;
  const size_t stride = cloud.shStride();
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      conversion.apply(&cloud.positions[i * 3], &cloud.rotations[i * 4], &cloud.scales[i * 3],
                       cloud.sh_degree, &cloud.sh[i * stride]);
    }
  });
}

}  // namespace stipple
