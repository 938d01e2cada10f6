#include "shot/effects_plan.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <numbers>

#include "base/error.h"

namespace stipple {

namespace {

__attribute__((format(printf, 1, 2))) std::string text(const char* format, ...) {
  char buffer[200];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof(buffer), format, arguments);
  va_end(arguments);
  return buffer;
}

double degrees(double radians) {
  return radians * 180 / std::numbers::pi;
}

const char* plural(uint64_t count) {
  return count == 1 ? "" : "s";
}

void requireWithin(double value, double low, double high, const char* name) {
  if (value >= low && value <= high) return;
  fail(ErrorCode::kInvalidArgument, text("%s is %g; %g to %g is allowed", name, value, low, high));
}

bool isPanoramic(const EffectFacts& facts) {
  return facts.camera_model != CameraModel::kPerspective &&
         facts.camera_model != CameraModel::kOrthographic;
}

/// What degrees above `degree` change colours by, root mean square.
double changeAbove(const EffectsSurvey& survey, int degree) {
  double sum = 0;
  for (int d = degree + 1; d <= survey.sh_degree; ++d) {
    const double change = survey.view_change[static_cast<size_t>(d)];
    sum += change * change;
  }
  return std::sqrt(sum);
}

EffectRow viewColour(const EffectFacts& facts, int& degree) {
  EffectRow row{Effect::kViewColour};
  if (facts.view_colour == EffectChoice::kOff) {
    degree = 0;
    row.reason = "Off by choice: colors are those of all directions together";
    return row;
  }
  if (facts.view_colour == EffectChoice::kOn) {
    row.is_on = true;
    row.reason = "On by choice: all harmonics that the splats have";
    return row;
  }
  if (!facts.survey) {
    row.is_on = true;
    row.reason = "All harmonics, until the splats have been looked at";
    return row;
  }
  const EffectsSurvey& survey = *facts.survey;
  if (survey.sh_degree == 0) {
    degree = 0;
    row.reason = "The splats have one color for all directions";
    return row;
  }
  const double all = changeAbove(survey, 0);
  if (all < kInvisibleChange) {
    degree = 0;
    row.reason = text("Colors change by %.4f with the view, less than shows", all);
    return row;
  }
  for (degree = 1; degree < survey.sh_degree; ++degree) {
    const double left = changeAbove(survey, degree);
    if (left * left <= (1 - facts.view_share) * all * all) break;
  }
  const double left = changeAbove(survey, degree);
  row.is_on = true;
  row.reason = text(
      "Harmonics up to degree %d of %d carry %.1f %% of the change of color with the view (%.3f)",
      degree, survey.sh_degree, 100 * (1 - left * left / (all * all)), all);
  return row;
}

EffectRow motion(const EffectFacts& facts) {
  EffectRow row{Effect::kMotion};
  row.is_on = facts.camera_moves || facts.moving_objects > 0;
  if (!row.is_on) {
    row.reason = "Neither camera nor splats move while the shutter is open";
  } else if (facts.moving_objects == 0) {
    row.reason = "The camera moves while the shutter is open";
  } else {
    row.reason =
        text("%s%llu splat object%s move%s while the shutter is open",
             facts.camera_moves ? "The camera and " : "",
             static_cast<unsigned long long>(facts.moving_objects), plural(facts.moving_objects),
             facts.moving_objects == 1 && !facts.camera_moves ? "s" : "");
  }
  return row;
}

EffectRow motionBlur(const EffectFacts& facts, bool moves) {
  EffectRow row{Effect::kMotionBlur};
  row.is_on = facts.motion_blur && moves;
  if (!facts.motion_blur) {
    row.reason = "Motion Blur is off in the render settings";
  } else if (!moves) {
    row.reason = "Motion Blur is on, but nothing moves while the shutter is open";
  } else {
    row.reason =
        text("Motion Blur is on, with the shutter open for %g frames", facts.shutter_frames);
  }
  return row;
}

EffectRow depthOfField(const EffectFacts& facts) {
  EffectRow row{Effect::kDepthOfField};
  row.is_on = facts.depth_of_field && facts.aperture_radius > 0;
  if (!facts.depth_of_field) {
    row.reason = "Depth of Field is off in the camera";
  } else if (!row.is_on) {
    row.reason = "The camera's aperture is closed: everything is sharp";
  } else {
    row.reason = text("The camera's aperture has a radius of %.3g mm and is focused at %.3g m",
                      1000 * facts.aperture_radius, facts.focus_distance);
  }
  return row;
}

EffectRow exactProjection(const EffectFacts& facts) {
  EffectRow row{Effect::kExactProjection};
  if (isPanoramic(facts)) {
    row.is_on = true;
    row.reason = "Panoramic cameras always see along rays";
    return row;
  }
  if (facts.camera_model == CameraModel::kOrthographic) {
    row.reason = "An orthographic camera: the quick projection is exact";
    return row;
  }
  if (facts.exact_projection != EffectChoice::kAuto) {
    row.is_on = facts.exact_projection == EffectChoice::kOn;
    row.reason = row.is_on ? "On by choice: splats are seen along the rays of the pixels"
                           : "Off by choice: splats are drawn as flat ellipses";
    return row;
  }
  if (!facts.survey || facts.survey->seen_count == 0) {
    row.reason = facts.survey ? "No splat is in view" : "The splats have not been looked at";
    return row;
  }
  const EffectsSurvey& survey = *facts.survey;
  row.is_on = survey.affine_error_px > facts.largest_error_px;
  const double angle = degrees(survey.field_of_view);
  const double bound = degrees(affineFieldOfView(survey.error_ahead_px, facts.largest_error_px));
  row.reason = text("Flat ellipses miss by up to %.2g px, %s %g px", survey.affine_error_px,
                    row.is_on ? "above" : "within", facts.largest_error_px);
  if (row.is_on && bound < 1) {
    row.reason += text(" at any field of view; this one is %.0f\u00b0", angle);
  } else {
    row.reason += text("; the field of view is %.0f\u00b0, and they %s do up to about %.0f\u00b0",
                       angle, row.is_on ? "would" : "will", bound);
  }
  return row;
}

EffectRow zoomAntialiasing(const EffectFacts& facts) {
  EffectRow row{Effect::kZoomAntialiasing};
  if (facts.zoom_antialiasing != EffectChoice::kAuto) {
    row.is_on = facts.zoom_antialiasing == EffectChoice::kOn;
    row.reason = row.is_on ? "On by choice: splats keep their light at every size"
                           : "Off by choice: splats have the low-pass that they were made for";
    return row;
  }
  if (!facts.survey || facts.survey->seen_count == 0) {
    row.reason = facts.survey ? "No splat is in view" : "The splats have not been looked at";
    return row;
  }
  row.is_on = facts.survey->widening > facts.largest_widening;
  row.reason = text("The low-pass makes splats %.3g times as large as they are, %s %g",
                    facts.survey->widening, row.is_on ? "above" : "within", facts.largest_widening);
  return row;
}

EffectRow ofSwitch(Effect effect, bool is_on, const char* on, const char* off) {
  EffectRow row{effect};
  row.is_on = is_on;
  row.reason = is_on ? on : off;
  return row;
}

EffectRow meshOcclusion(const EffectFacts& facts) {
  EffectRow row{Effect::kMeshOcclusion};
  row.is_on = facts.hiding_meshes > 0;
  row.reason = row.is_on ? text("%llu mesh%s can hide splats",
                                static_cast<unsigned long long>(facts.hiding_meshes),
                                facts.hiding_meshes == 1 ? "" : "es")
                         : "No mesh hides splats";
  return row;
}

EffectRow globalOrder(const EffectFacts& facts) {
  EffectRow row{Effect::kGlobalOrder};
  if (facts.global_order != EffectChoice::kAuto) {
    row.is_on = facts.global_order == EffectChoice::kOn;
    row.reason = row.is_on
                     ? "On by choice: splats of all objects are sorted together"
                     : "Off by choice: each object is drawn as a whole, farther ones behind it";
    return row;
  }
  if (!facts.survey) {
    row.is_on = true;
    row.reason = "Splats of all objects are sorted together, until they have been looked at";
    return row;
  }
  const EffectsSurvey& survey = *facts.survey;
  row.is_on = survey.mixed_count > 0;
  if (row.is_on) {
    row.reason = text("%llu of %llu objects share a range of depth",
                      static_cast<unsigned long long>(survey.mixed_count),
                      static_cast<unsigned long long>(survey.object_count));
  } else {
    row.reason = survey.object_count > 1 ? "No two objects share a range of depth"
                                         : "There is one object at most";
  }
  return row;
}

}  // namespace

EffectsPlan planEffects(const EffectFacts& facts) {
  requireWithin(facts.view_share, 0, 1, "view_share");
  requireWithin(facts.largest_error_px, 1e-6, 1e6, "largest_error_px");
  requireWithin(facts.largest_widening, 1, 1e6, "largest_widening");
  requireWithin(facts.aperture_radius, 0, 1e6, "aperture_radius");
  EffectsPlan plan;
  plan.rows.push_back(viewColour(facts, plan.sh_degree));
  plan.rows.push_back(motion(facts));
  plan.rows.push_back(motionBlur(facts, plan.rows.back().is_on));
  plan.rows.push_back(depthOfField(facts));
  plan.rows.push_back(exactProjection(facts));
  plan.rows.push_back(zoomAntialiasing(facts));
  plan.rows.push_back(ofSwitch(Effect::kTransparentFilm, facts.transparent_film,
                               "The film is transparent: no world behind the splats",
                               "The film shows the world"));
  plan.rows.push_back(ofSwitch(Effect::kDepthPass, facts.depth_pass,
                               "The view layer has a pass of depths",
                               "The view layer has no pass of depths"));
  plan.rows.push_back(ofSwitch(Effect::kNormalPass, facts.normal_pass,
                               "The view layer has a pass of normals",
                               "The view layer has no pass of normals"));
  plan.rows.push_back(ofSwitch(Effect::kObjectIndexPass, facts.object_index_pass,
                               "The view layer has a pass of object indices",
                               "The view layer has no pass of object indices"));
  plan.rows.push_back(meshOcclusion(facts));
  plan.rows.push_back(globalOrder(facts));
  for (EffectRow& row : plan.rows) row.seconds = facts.seconds[static_cast<size_t>(row.effect)];
  return plan;
}

}  // namespace stipple
