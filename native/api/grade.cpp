#include "data/clouds/colour_grade.h"

#include <algorithm>

#include "api/conversions.h"

using namespace stipple;
using namespace stipple::api;

namespace {

StippleGrade gradeTo(const ColourGrade& made) {
  StippleGrade grade = {};
  grade.struct_size = sizeof(StippleGrade);
  std::copy(made.matrix.begin(), made.matrix.end(), grade.matrix);
  std::copy(made.offset.begin(), made.offset.end(), grade.offset);
  grade.opacity = made.opacity;
  return grade;
}

}  // namespace

extern "C" {

void stipple_grade_settings_init(StippleGradeSettings* settings) {
  if (!settings) return;
  const GradeSettings defaults;
  *settings = {};
  settings->struct_size = sizeof(StippleGradeSettings);
  settings->exposure = defaults.exposure;
  std::copy(defaults.tint.begin(), defaults.tint.end(), settings->tint);
  settings->saturation = defaults.saturation;
  settings->opacity = defaults.opacity;
}

void stipple_grade_init(StippleGrade* grade) {
  if (grade) *grade = gradeTo(ColourGrade());
}

StippleStatus stipple_grade_from_settings(const StippleGradeSettings* settings,
                                          uint32_t colour_space, StippleGrade* grade) {
  return guarded([&] {
    StippleGradeSettings defaults;
    stipple_grade_settings_init(&defaults);
    const StippleGradeSettings given =
        completed(&require(settings, "settings"), defaults, "settings");
    GradeSettings wanted;
    wanted.exposure = given.exposure;
    std::copy(given.tint, given.tint + 3, wanted.tint.begin());
    wanted.saturation = given.saturation;
    wanted.opacity = given.opacity;
    const auto space = enumValue<ColourSpace>(colour_space, 1, "colour_space");
    deliver(grade, gradeTo(gradeOf(wanted, space)), "grade");
  });
}

StippleStatus stipple_cloud_grade(const StippleCloud* cloud, const StippleGrade* grade,
                                  StippleCloud** graded) {
  return guarded([&] {
    require(cloud, "cloud");
    require(graded, "graded");
    auto made = std::make_shared<SplatCloud>(*cloud->cloud);
    bakeGrade(*made, gradeFrom(require(grade, "grade"), "grade"));
    *graded = new StippleCloud{cloud->context, std::move(made)};
  });
}

}  // extern "C"
