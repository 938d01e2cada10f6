#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace stipple {

class HarmonicRotation;
struct SplatCloud;

/// Which way the axes x, y and z of a cloud's positions point: Left or Right, Up or Down, Front or
/// Back, as the letters of the name say in that order. The numbers are those that SPZ files use.
enum class Frame : uint32_t {
  kUnknown = 0,
  kLDB = 1,
  kRDB = 2,
  kLUB = 3,
  kRUB = 4,  ///< SPZ
  kLDF = 5,
  kRDF = 6,  ///< COLMAP, trained 3DGS files
  kLUF = 7,  ///< glTF: models face along z
  kRUF = 8,  ///< left-handed, Unity
  kLFD = 9,
  kRFD = 10,
  kLFU = 11,
  kRFU = 12,  ///< Blender: Z up
  kLBD = 13,
  kRBD = 14,
  kLBU = 15,
  kRBU = 16,
};

constexpr uint32_t kLastFrame = 16;

/// What an unknown frame is taken for where a format demands one: the frame of trained files.
constexpr Frame kConventionalFrame = Frame::kRDF;

/// "RDF" and so on; "unknown" for kUnknown.
const char* frameName(Frame frame);
/// The frame of a name in capitals, kUnknown included; nothing for other names.
std::optional<Frame> frameFromName(const std::string& name);

/// The change of coordinates from one frame to another: a signed permutation of the axes.
/// Positions, scales and rotations change by exact sign flips and swaps, and so do harmonics where
/// no axes are swapped; else they are turned, exact up to rounding. A mirroring change (one frame
/// left-handed, the other right-handed) shows the same splats in a mirrored coordinate system.
class FrameConversion {
 public:
  /// In: kUnknown stands for kConventionalFrame.
  FrameConversion(Frame from, Frame to);
  ~FrameConversion();
  FrameConversion(const FrameConversion&) = delete;
  FrameConversion& operator=(const FrameConversion&) = delete;
  bool isIdentity() const { return identity_; }
  /// In and out: one splat: position [3], rotation [4], scale [3], harmonics [(degree+1)^2,3].
  void apply(float* position, float* rotation, float* scale, int degree, float* sh) const;

 private:
  bool identity_ = true;
  bool swaps_ = false;
  float turn_sign_ = 1.0f;                       ///< determinant
  std::array<size_t, 3> source_{0, 1, 2};        ///< axis that output axis i comes from
  std::array<float, 3> sign_{1, 1, 1};           ///< of output axis i
  std::array<float, 25> harmonic_sign_;          ///< without swaps: factor of each coefficient
  std::unique_ptr<HarmonicRotation> harmonics_;  ///< with swaps
};

/// Brings a cloud into a frame and labels it so. Cost: O(N), all threads.
void convertFrame(SplatCloud& cloud, Frame to);

}  // namespace stipple
