#include "api/conversions.h"

#include <algorithm>
#include <cstddef>

namespace stipple::api {

static_assert(static_cast<uint32_t>(Precision::kDouble) == STIPPLE_PRECISION_DOUBLE);
static_assert(static_cast<uint32_t>(Antialiasing::kSamples) == STIPPLE_SAMPLING_SAMPLES);
static_assert(static_cast<uint32_t>(AccuracyLevel::kReference) == STIPPLE_ACCURACY_REFERENCE);
static_assert(static_cast<uint32_t>(ShotMethod::kRaysUnlimited) == STIPPLE_RENDER_RAYS_UNLIMITED);
static_assert(static_cast<uint32_t>(OutputColour::kComposited) == STIPPLE_OUTPUT_COMPOSITED);

namespace {

/// Reads the values of a cloud once in its life. One that is not valid is left to whoever draws it,
/// who says what is wrong.
bool isChecked(const StippleCloud& cloud) {
  if (cloud.is_checked.load(std::memory_order_relaxed)) return true;
  const SplatCloud& splats = *cloud.cloud;
  validateSizes(splats, "cloud");
  if (!rowsAreValid(splats, 0, splats.size())) return false;
  cloud.is_checked.store(true, std::memory_order_relaxed);
  return true;
}

std::vector<Mat4d> matricesFrom(const double* matrices, size_t count) {
  std::vector<Mat4d> made;
  for (size_t i = 0; matrices && i < count; ++i) {
    made.push_back(Eigen::Map<const Mat4d>(matrices + i * 16));
  }
  return made;
}

std::vector<std::shared_ptr<const SplatCloud>> cloudsFrom(const StippleCloud* const* clouds,
                                                          size_t count) {
  std::vector<std::shared_ptr<const SplatCloud>> made;
  for (size_t i = 0; clouds && i < count; ++i) {
    made.push_back(clouds[i] ? clouds[i]->cloud : nullptr);
  }
  return made;
}

Shutter shutterFrom(const StippleShutter& shutter, size_t instance_count) {
  Shutter made;
  made.step_count = shutter.step_count;
  if (made.step_count < 2 || made.step_count > kMaxShutterSteps) {
    fail(ErrorCode::kInvalidArgument, "options->shutter->step_count is " +
                                          std::to_string(made.step_count) +
                                          "; 2 to 1025 is allowed");
  }
  made.camera = matricesFrom(shutter.cameras, made.step_count);
  made.instances = matricesFrom(shutter.instances, made.step_count * instance_count);
  made.clouds = cloudsFrom(shutter.clouds, made.step_count * instance_count);
  if (shutter.curve) made.curve.assign(shutter.curve, shutter.curve + shutter.curve_count);
  return made;
}

Sampling samplingFrom(const StippleRenderOptions& given, const Instances& instances) {
  Sampling sampling;
  sampling.samples = given.samples;
  if (given.aperture) {
    const StippleAperture aperture = complete(given.aperture, "options->aperture");
    sampling.aperture = {aperture.aperture_radius, aperture.focus_distance, aperture.blades,
                         aperture.rotation, aperture.ratio == 0 ? 1.0 : aperture.ratio};
  }
  if (given.shutter) {
    const StippleShutter shutter =
        completeUpTo(given.shutter, offsetof(StippleShutter, clouds), "options->shutter");
    sampling.shutter = shutterFrom(shutter, instances.list.size());
  }
  validate(sampling, instances.list);
  return sampling;
}

RenderOptions optionsFrom(const StippleRenderOptions& given) {
  RenderOptions options;
  options.low_pass = enumValue<LowPass>(given.low_pass, 3, "options->low_pass");
  options.blend_space = enumValue<BlendSpace>(given.blend_space, 1, "options->blend_space");
  options.object_order = enumValue<ObjectOrder>(given.object_order, 1, "options->object_order");
  options.sh_degree_limit = enumValue<int>(given.sh_degree_limit, 4, "options->sh_degree_limit");
  options.with_background =
      enumValue<uint32_t>(given.with_background, 1, "options->with_background") == 1;
  for (int c = 0; c < 3; ++c) {
    requireFinite(given.background[c], "options->background");
    options.background[c] = given.background[c];
  }
  options.surface = {given.surface_width, given.surface_height, given.surface_depth,
                     given.surface_colour, given.matte_opacity};
  options.splats_apart = given.surface_colour != nullptr;
  return options;
}

}  // namespace

void requireRoom(const SplatCloud& cloud, const std::string& path, const MemoryLimit& limit) {
  const uint64_t floats = cloud.size() * (11 + cloud.shStride());
  limit.requireMemory(floats * sizeof(float), ("the splats of '" + path + "'").c_str());
}

SplatWriteOptions writeOptions(const StippleCloudSaveOptions* options) {
  StippleCloudSaveOptions defaults;
  stipple_cloud_save_options_init(&defaults);
  const StippleCloudSaveOptions given = completed(options, defaults, "options");
  SplatWriteOptions write;
  write.ascii = enumValue<uint32_t>(given.ascii, 1, "options->ascii") == 1;
  write.half = enumValue<uint32_t>(given.half, 1, "options->half") == 1;
  write.sh_degree_limit = enumValue<int>(given.sh_degree_limit, static_cast<uint32_t>(kMaxShDegree),
                                         "options->sh_degree_limit");
  write.version = enumValue<int>(given.format_version, 255, "options->format_version");
  write.frame = enumValue<Frame>(given.frame, kLastFrame, "options->frame");
  return write;
}

ColourGrade gradeFrom(const StippleGrade& grade, const char* name) {
  const StippleGrade given = complete(&grade, name);
  ColourGrade made;
  std::copy(given.matrix, given.matrix + 9, made.matrix.begin());
  std::copy(given.offset, given.offset + 3, made.offset.begin());
  made.opacity = given.opacity;
  validate(made, name);
  return made;
}

Instances instancesFrom(const StippleInstance* instances, uint64_t count) {
  Instances made;
  const StructArray<StippleInstance> array(instances, count, "instances");
  for (uint64_t i = 0; i < count; ++i) {
    const std::string name = array.nameOf(i);
    const StippleInstance given =
        completeUpTo(array.at(i), offsetof(StippleInstance, grade), name.c_str());
    const StippleCloud& cloud = require(given.cloud, (name + ".cloud").c_str());
    for (const double value : given.matrix) requireFinite(value, (name + ".matrix").c_str());
    requireFinite(given.time, (name + ".time").c_str());
    SplatInstance placed;
    placed.cloud = cloud.cloud.get();
    placed.holdout = enumValue<uint32_t>(given.holdout, 1, (name + ".holdout").c_str()) == 1;
    placed.values_are_checked = isChecked(cloud);
    placed.object_to_world = Eigen::Map<const Mat4d>(given.matrix);
    if (given.grade) placed.grade = gradeFrom(*given.grade, (name + ".grade").c_str());
    made.shares.push_back(cloud.cloud);
    made.list.push_back(placed);
  }
  return made;
}

AccuracySettings accuracyFrom(const StippleAccuracy* given, const char* name) {
  const auto field = [&](const char* knob) { return std::string(name) + "->" + knob; };
  const auto level = enumValue<AccuracyLevel>(completeUpTo(given, 2 * sizeof(uint32_t), name).level,
                                              3, field("level").c_str());
  const StippleAccuracy a = completed(given, accuracyTo(accuracyOf(level)), name);
  AccuracySettings made;
  made.level = level;
  made.order = enumValue<uint32_t>(a.order, 1, field("order").c_str()) == STIPPLE_ORDER_PIXEL
                   ? RayOrder::kResponse
                   : RayOrder::kCentre;
  made.projection =
      enumValue<uint32_t>(a.projection, 1, field("projection").c_str()) == STIPPLE_PROJECTION_RAY
          ? RayProjection::kRay
          : RayProjection::kAffine;
  made.antialiasing = enumValue<Antialiasing>(a.antialiasing, 2, field("antialiasing").c_str());
  made.sh_degree_limit = enumValue<int>(a.sh_degree_limit, 4, field("sh_degree_limit").c_str());
  made.precision = enumValue<Precision>(a.precision, 1, field("precision").c_str());
  made.samples_per_side = a.samples_per_side;
  made.least_alpha = a.min_alpha;
  made.budget_share = a.budget_share;
  validate(made, name);
  return made;
}

StippleAccuracy accuracyTo(const AccuracySettings& accuracy) {
  StippleAccuracy a = {};
  a.struct_size = sizeof(a);
  a.level = static_cast<uint32_t>(accuracy.level);
  a.order = accuracy.order == RayOrder::kResponse ? STIPPLE_ORDER_PIXEL : STIPPLE_ORDER_CENTRE;
  a.projection = accuracy.projection == RayProjection::kRay ? STIPPLE_PROJECTION_RAY
                                                            : STIPPLE_PROJECTION_AFFINE;
  a.antialiasing = static_cast<uint32_t>(accuracy.antialiasing);
  a.samples_per_side = accuracy.samples_per_side;
  a.sh_degree_limit = static_cast<uint32_t>(accuracy.sh_degree_limit);
  a.precision = static_cast<uint32_t>(accuracy.precision);
  a.min_alpha = accuracy.least_alpha;
  a.budget_share = accuracy.budget_share;
  return a;
}

ShotSettings shotFrom(const StippleRenderOptions* options, const Instances& instances) {
  StippleRenderOptions defaults;
  stipple_render_options_init(&defaults);
  const StippleRenderOptions given = completed(options, defaults, "options");
  ShotSettings settings;
  settings.method = enumValue<ShotMethod>(given.method, 3, "options->method");
  settings.options = optionsFrom(given);
  const auto output = enumValue<OutputColour>(given.output_colour, 1, "options->output_colour");
  settings.splat_light = given.splat_light;
  settings.background_image = given.background_image;
  settings.surroundings = {given.surroundings, given.surroundings_width, given.surroundings_height};
  settings.solid_depth = enumValue<uint32_t>(given.solid_depth, 1, "options->solid_depth") == 1;
  if (given.accuracy) takeAccuracy(accuracyFrom(given.accuracy, "options->accuracy"), settings);
  settings.sampling = samplingFrom(given, instances);
  takeOutput(output, instances, settings);
  return settings;
}

}  // namespace stipple::api
