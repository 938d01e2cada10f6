#include <algorithm>
#include <cstddef>
#include <cstring>
#include <limits>
#include <string>

#include "api/camera.h"
#include "api/conversions.h"
#include "base/parallel.h"
#include "shot/effects_plan.h"

using namespace stipple;
using namespace stipple::api;

static_assert(STIPPLE_EFFECT_COUNT == kEffectCount);
static_assert(sizeof(StippleEffectFacts::seconds) == sizeof(EffectFacts::seconds));
static_assert(sizeof(StippleEffectsSurvey::view_change) == sizeof(EffectsSurvey::view_change));

namespace {

bool flag(uint32_t value, const char* name) {
  return enumValue<uint32_t>(value, 1, name) == 1;
}

EffectChoice choice(uint32_t value, const char* name) {
  return enumValue<EffectChoice>(value, STIPPLE_EFFECT_OFF, name);
}

EffectsSurvey surveyFrom(const StippleEffectsSurvey& given) {
  EffectsSurvey survey;
  survey.sh_degree = enumValue<int>(given.sh_degree, kMaxShDegree, "facts->survey->sh_degree");
  survey.splat_count = given.splat_count;
  survey.looked_count = given.inspected_count;
  survey.seen_count = given.seen_count;
  survey.object_count = given.object_count;
  survey.mixed_count = given.mixed_count;
  std::copy(std::begin(given.view_change), std::end(given.view_change), survey.view_change.begin());
  survey.affine_error_px = given.affine_error_px;
  survey.error_ahead_px = given.error_ahead_px;
  survey.field_of_view = given.field_of_view;
  survey.widening = given.widening;
  return survey;
}

EffectFacts factsFrom(const StippleEffectFacts& given) {
  EffectFacts facts;
  facts.view_colour = choice(given.view_colour, "facts->view_colour");
  facts.exact_projection = choice(given.exact_projection, "facts->exact_projection");
  facts.zoom_antialiasing = choice(given.zoom_antialiasing, "facts->zoom_antialiasing");
  facts.global_order = choice(given.global_order, "facts->global_order");
  facts.camera_model = enumValue<CameraModel>(given.camera_model, STIPPLE_CAMERA_FISHEYE_EQUISOLID,
                                              "facts->camera_model");
  facts.motion_blur = flag(given.motion_blur, "facts->motion_blur");
  facts.camera_moves = flag(given.camera_moves, "facts->camera_moves");
  facts.moving_objects = given.moving_objects;
  facts.shutter_frames = given.shutter_frames;
  facts.depth_of_field = flag(given.depth_of_field, "facts->depth_of_field");
  facts.transparent_film = flag(given.transparent_film, "facts->transparent_film");
  facts.depth_pass = flag(given.depth_pass, "facts->depth_pass");
  facts.normal_pass = flag(given.normal_pass, "facts->normal_pass");
  facts.object_index_pass = flag(given.object_index_pass, "facts->object_index_pass");
  facts.aperture_radius = given.aperture_radius;
  facts.focus_distance = given.focus_distance;
  facts.hiding_meshes = given.hiding_meshes;
  facts.view_share = given.view_share;
  facts.largest_error_px = given.largest_error_px;
  facts.largest_widening = given.largest_widening;
  std::copy(std::begin(given.seconds), std::end(given.seconds), facts.seconds.begin());
  return facts;
}

StippleEffectFacts defaultFacts() {
  const EffectFacts defaults;
  StippleEffectFacts facts = {};
  facts.struct_size = sizeof(facts);
  facts.shutter_frames = defaults.shutter_frames;
  facts.view_share = defaults.view_share;
  facts.largest_error_px = defaults.largest_error_px;
  facts.largest_widening = defaults.largest_widening;
  std::copy(defaults.seconds.begin(), defaults.seconds.end(), facts.seconds);
  return facts;
}

StippleEffectsSurvey surveyTo(const EffectsSurvey& seen) {
  StippleEffectsSurvey made = {};
  made.sh_degree = static_cast<uint32_t>(seen.sh_degree);
  made.splat_count = seen.splat_count;
  made.inspected_count = seen.looked_count;
  made.seen_count = seen.seen_count;
  made.object_count = seen.object_count;
  made.mixed_count = seen.mixed_count;
  std::copy(seen.view_change.begin(), seen.view_change.end(), made.view_change);
  made.affine_error_px = seen.affine_error_px;
  made.error_ahead_px = seen.error_ahead_px;
  made.field_of_view = seen.field_of_view;
  made.widening = seen.widening;
  return made;
}

StippleEffectRow rowTo(const EffectRow& row, int sh_degree) {
  StippleEffectRow made = {};
  made.effect = static_cast<uint32_t>(row.effect);
  made.is_on = row.is_on ? 1 : 0;
  made.sh_degree = row.effect == Effect::kViewColour ? static_cast<uint32_t>(sh_degree) : 0;
  made.seconds = row.seconds;
  std::strncpy(made.reason, row.reason.c_str(), sizeof(made.reason) - 1);
  return made;
}

/// Older and newer callers have shorter and longer rows, which lie that far apart; the first says
/// so.
void deliverRows(const EffectsPlan& plan, StippleEffectRow* rows, uint64_t capacity) {
  const size_t step = require(rows, "rows").struct_size;
  if (step % alignof(StippleEffectRow) != 0) {
    failStructSize("rows", step, sizeof(StippleEffectRow));
  }
  if (capacity < plan.rows.size()) {
    fail(ErrorCode::kBufferTooSmall, "capacity is " + std::to_string(capacity) + "; " +
                                         std::to_string(plan.rows.size()) + " rows need room");
  }
  auto* bytes = reinterpret_cast<std::byte*>(rows);
  for (const EffectRow& row : plan.rows) {
    auto* out = reinterpret_cast<StippleEffectRow*>(bytes);
    out->struct_size = static_cast<uint32_t>(step);
    deliver(out, rowTo(row, plan.sh_degree), "rows");
    bytes += step;
  }
}

}  // namespace

extern "C" {

StippleStatus stipple_effects_survey(StippleContext* context, const StippleInstance* instances,
                                     uint64_t count, const StippleCamera* camera,
                                     StippleEffectsSurvey* survey) {
  return guarded([&] {
    const StippleContext& owner = require(context, "context");
    require(survey, "survey");
    const Instances placed = instancesFrom(instances, count);
    const Camera view = cameraFrom(camera);
    EffectsSurvey seen;
    withThreads(owner.state->thread_count, [&] { seen = surveyEffects(placed.list, view); });
    deliver(survey, surveyTo(seen), "survey");
  });
}

void stipple_effect_facts_init(StippleEffectFacts* facts) {
  if (facts) *facts = defaultFacts();
}

StippleStatus stipple_effects_plan(const StippleEffectFacts* facts, StippleEffectRow* rows,
                                   uint64_t capacity) {
  return guarded([&] {
    const StippleEffectFacts given = completed(&require(facts, "facts"), defaultFacts(), "facts");
    EffectFacts wanted = factsFrom(given);
    EffectsSurvey survey;
    if (given.survey) {
      const StippleEffectsSurvey seen = complete(given.survey, "facts->survey");
      survey = surveyFrom(seen);
      wanted.survey = &survey;
    }
    deliverRows(planEffects(wanted), rows, capacity);
  });
}

}  // extern "C"
