#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "shot/effects_survey.h"

// From what a scene asks of a picture, and what its splats say, to the effects that it needs.

namespace stipple {

/// In the order of a plan's rows.
enum class Effect : uint32_t {
  kViewColour = 0,
  kMotion,
  kMotionBlur,
  kDepthOfField,
  kExactProjection,
  kZoomAntialiasing,
  kTransparentFilm,
  kDepthPass,
  kNormalPass,
  kObjectIndexPass,
  kMeshOcclusion,
  kGlobalOrder,
};
constexpr size_t kEffectCount = 12;

/// Of effects that no switch of the scene decides.
enum class EffectChoice : uint32_t { kAuto = 0, kOn = 1, kOff = 2 };

struct EffectFacts {
  EffectChoice view_colour = EffectChoice::kAuto;
  EffectChoice exact_projection = EffectChoice::kAuto;
  EffectChoice zoom_antialiasing = EffectChoice::kAuto;
  EffectChoice global_order = EffectChoice::kAuto;
  CameraModel camera_model = CameraModel::kPerspective;
  bool motion_blur = false;     ///< switched on in the scene
  bool camera_moves = false;    ///< while the shutter is open
  uint64_t moving_objects = 0;  ///< instances of splats that do
  double shutter_frames = 0.5;  ///< how long it is open
  bool depth_of_field = false;  ///< switched on in the camera
  double aperture_radius = 0;   ///< metres
  double focus_distance = 0;    ///< metres
  bool transparent_film = false;
  bool depth_pass = false;
  bool normal_pass = false;
  bool object_index_pass = false;
  uint64_t hiding_meshes = 0;             ///< that stand between splats
  const EffectsSurvey* survey = nullptr;  ///< null: nobody has looked at the splats
  /// Share of the view-dependent change of colours that the degree of the plan carries.
  double view_share = 0.999;
  double largest_error_px = 1.0;  ///< of the affine projection; above, the exact one is on
  /// Area with the low-pass over area without; above, anti-aliasing for all zooms is on.
  double largest_widening = 2;
  /// Seconds that each takes, measured; NaN: nobody has measured.
  std::array<double, kEffectCount> seconds;

  EffectFacts() { seconds.fill(std::numeric_limits<double>::quiet_NaN()); }
};

struct EffectRow {
  Effect effect = Effect::kViewColour;
  bool is_on = false;
  std::string reason = {};  ///< one sentence, without a full stop, 200 characters at most
  double seconds = 0;       ///< as in the facts
};

struct EffectsPlan {
  std::vector<EffectRow> rows;   ///< one of each effect
  int sh_degree = kMaxShDegree;  ///< up to which harmonics are needed
  bool isOn(Effect effect) const { return rows[static_cast<size_t>(effect)].is_on; }
};

/// Changes of colour below this (root mean square) never show: half a step of 8 bits.
constexpr double kInvisibleChange = 0.5 / 255.0;

/// Cost: none. Errors: kInvalidArgument for numbers outside their range.
EffectsPlan planEffects(const EffectFacts& facts);

}  // namespace stipple
