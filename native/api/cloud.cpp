#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <utility>

#include "api/conversions.h"
#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "base/parallel.h"
#include "data/clouds/cloud_columns.h"
#include "data/clouds/cloud_comparison.h"
#include "data/clouds/cloud_transform.h"
#include "data/position_bounds.h"
#include "io/splats/splat_file.h"
#include "io/usd/usd_scene_writer.h"

using namespace stipple;
using namespace stipple::api;

static_assert(std::size(StippleCloudColumns{}.rest) == kMaxShColumns);

namespace {

std::vector<UsdObject> sceneObjects(const StippleSceneObject* objects, uint64_t count) {
  std::vector<UsdObject> made;
  const StructArray<StippleSceneObject> array(objects, count, "objects");
  for (uint64_t i = 0; i < count; ++i) {
    const std::string name = array.nameOf(i);
    const StippleSceneObject given = complete(array.at(i), name.c_str());
    UsdObject object;
    object.name = &require(given.name_utf8, (name + ".name_utf8").c_str());
    object.cloud = require(given.cloud, (name + ".cloud").c_str()).cloud.get();
    object.matrix = Eigen::Map<const Mat4d>(given.matrix);
    made.push_back(std::move(object));
  }
  return made;
}

/// A handle of values that are in range, with quaternions of length one.
StippleCloud* handleOf(const Context& context, SplatCloud cloud) {
  validate(cloud, "splats");
  normaliseRotations(cloud);
  return new StippleCloud{context, std::make_shared<const SplatCloud>(std::move(cloud))};
}

/// What StippleCloudArrays and StippleCloudColumns have in common.
template <class Given>
void describe(const Given& given, const char* name, SplatCloud& cloud) {
  const auto field = [&](const char* member) { return std::string(name) + "->" + member; };
  cloud.colour_space = enumValue<ColourSpace>(given.colour_space, 1, field("colour_space").c_str());
  cloud.antialias = enumValue<Antialias>(given.antialias, 1, field("antialias").c_str());
  cloud.frame = enumValue<Frame>(given.frame, kLastFrame, field("frame").c_str());
}

int degreeOf(uint32_t given, const char* name) {
  if (given > static_cast<uint32_t>(kMaxShDegree)) {
    fail(ErrorCode::kInvalidArgument,
         std::string(name) + "->sh_degree is " + std::to_string(given) + "; 0 to 4 is allowed");
  }
  return static_cast<int>(given);
}

SplatCloud fromArrays(const StippleCloudArrays& arrays) {
  SplatCloud cloud;
  cloud.sh_degree = degreeOf(arrays.sh_degree, "arrays");
  describe(arrays, "arrays", cloud);
  const size_t count = arrays.count;
  if (count > 0) {
    cloud.positions.assign(&require(arrays.positions, "arrays->positions"),
                           arrays.positions + count * 3);
    cloud.rotations.assign(&require(arrays.rotations, "arrays->rotations"),
                           arrays.rotations + count * 4);
    cloud.scales.assign(&require(arrays.scales, "arrays->scales"), arrays.scales + count * 3);
    cloud.opacities.assign(&require(arrays.opacities, "arrays->opacities"),
                           arrays.opacities + count);
    cloud.sh.assign(&require(arrays.sh, "arrays->sh"), arrays.sh + count * cloud.shStride());
  }
  return cloud;
}

SplatCloud fromColumns(const StippleCloudColumns& given) {
  const int degree = degreeOf(given.sh_degree, "columns");
  CloudColumns<const float> columns;
  if (given.count > 0) {
    columns.positions = &require(given.positions, "columns->positions");
    columns.rotations = &require(given.rotations, "columns->rotations");
    columns.scales = &require(given.scales, "columns->scales");
    columns.base = &require(given.base, "columns->base");
    for (size_t k = 0; k + 1 < shCoefficientCount(degree); ++k) {
      const std::string name = "columns->rest[" + std::to_string(k) + "]";
      columns.rest[k] = &require(given.rest[k], name.c_str());
    }
  }
  SplatCloud cloud = cloudFromColumns(columns, given.count, degree);
  describe(given, "columns", cloud);
  return cloud;
}

void requireCapacity(uint64_t capacity, size_t count) {
  if (capacity < count) {
    fail(ErrorCode::kBufferTooSmall, "buffers->capacity is " + std::to_string(capacity) +
                                         " splats; " + std::to_string(count) + " are needed");
  }
}

void copyTo(const std::vector<float>& values, float* out) {
  if (out && !values.empty()) std::memcpy(out, values.data(), values.size() * sizeof(float));
}

const SplatFormat& requireFormat(uint64_t index) {
  if (index >= splatFormats().size()) {
    fail(ErrorCode::kInvalidArgument, "index is " + std::to_string(index) + "; 0 to " +
                                          std::to_string(splatFormats().size() - 1) +
                                          " is allowed");
  }
  return splatFormats()[static_cast<size_t>(index)];
}

std::vector<const SplatCloud*> cloudsOf(const StippleCloud* const* levels, uint64_t level_count) {
  std::vector<const SplatCloud*> clouds;
  for (uint64_t i = 0; i < level_count; ++i) {
    clouds.push_back(require(levels[i], ("levels[" + std::to_string(i) + "]").c_str()).cloud.get());
  }
  return clouds;
}

}  // namespace

extern "C" {

StippleStatus stipple_cloud_create(StippleContext* context, const StippleCloudArrays* arrays,
                                   StippleCloud** cloud) {
  return guarded([&] {
    require(context, "context");
    require(cloud, "cloud");
    const StippleCloudArrays given =
        completeUpTo(arrays, offsetof(StippleCloudArrays, frame), "arrays");
    withThreads(context->state->thread_count,
                [&] { *cloud = handleOf(context->state, fromArrays(given)); });
  });
}

StippleStatus stipple_cloud_create_from_columns(StippleContext* context,
                                                const StippleCloudColumns* columns,
                                                StippleCloud** cloud) {
  return guarded([&] {
    require(context, "context");
    require(cloud, "cloud");
    const StippleCloudColumns given = complete(columns, "columns");
    withThreads(context->state->thread_count,
                [&] { *cloud = handleOf(context->state, fromColumns(given)); });
  });
}

void stipple_cloud_free(StippleCloud* cloud) {
  delete cloud;
}

StippleStatus stipple_cloud_info(const StippleCloud* cloud, StippleCloudInfo* info) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    StippleCloudInfo out = {};
    out.sh_degree = static_cast<uint32_t>(splats.sh_degree);
    out.colour_space = static_cast<uint32_t>(splats.colour_space);
    out.antialias = static_cast<uint32_t>(splats.antialias);
    out.count = splats.size();
    fillBounds(splats.positions, out.bounds_min, out.bounds_max);
    out.frame = static_cast<uint32_t>(splats.frame);
    deliver(info, out, "info");
  });
}

StippleStatus stipple_cloud_read(const StippleCloud* cloud, const StippleCloudBuffers* buffers) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    const StippleCloudBuffers out = complete(buffers, "buffers");
    requireCapacity(out.capacity, splats.size());
    copyTo(splats.positions, out.positions);
    copyTo(splats.rotations, out.rotations);
    copyTo(splats.scales, out.scales);
    copyTo(splats.opacities, out.opacities);
    copyTo(splats.sh, out.sh);
  });
}

StippleStatus stipple_cloud_read_columns(const StippleCloud* cloud,
                                         const StippleCloudColumnBuffers* buffers) {
  return guarded([&] {
    const SplatCloud& splats = *require(cloud, "cloud").cloud;
    const StippleCloudColumnBuffers out = complete(buffers, "buffers");
    requireCapacity(out.capacity, splats.size());
    CloudColumns<float> columns{out.positions, out.rotations, out.scales, out.base, {}};
    std::copy(std::begin(out.rest), std::end(out.rest), columns.rest.begin());
    withThreads(cloud->context->thread_count, [&] { readColumns(splats, columns); });
  });
}

StippleStatus stipple_cloud_load(StippleContext* context, const char* path_utf8,
                                 StippleCloud** cloud) {
  return guarded([&] {
    require(context, "context");
    require(cloud, "cloud");
    const std::string path = &require(path_utf8, "path_utf8");
    withThreads(context->state->thread_count, [&] {
      auto splats = std::make_shared<const SplatCloud>(readSplatFile(path));
      requireRoom(*splats, path, *context->state);
      *cloud = new StippleCloud{context->state, std::move(splats)};
    });
  });
}

StippleStatus stipple_cloud_load_start(StippleContext* context, const char* path_utf8,
                                       StippleJob** job) {
  return guarded([&] {
    const Context state = require(context, "context").state;
    const std::string path = &require(path_utf8, "path_utf8");
    require(job, "job") = startJob(state, [state, path](Progress& progress) -> JobResult {
      auto splats = std::make_shared<const SplatCloud>(readSplatFile(path, &progress));
      requireRoom(*splats, path, *state);
      return splats;
    });
  });
}

void stipple_cloud_save_options_init(StippleCloudSaveOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleCloudSaveOptions);
  options->sh_degree_limit = static_cast<uint32_t>(kMaxShDegree);
}

StippleStatus stipple_cloud_save(const StippleCloud* cloud, const char* path_utf8,
                                 const StippleCloudSaveOptions* options) {
  return guarded([&] {
    require(cloud, "cloud");
    const std::string path = &require(path_utf8, "path_utf8");
    const SplatWriteOptions write = writeOptions(options);
    withThreads(cloud->context->thread_count, [&] { writeSplatFile(*cloud->cloud, path, write); });
  });
}

StippleStatus stipple_scene_save(const StippleSceneObject* objects, uint64_t count, uint32_t frame,
                                 const char* path_utf8, const StippleCloudSaveOptions* options) {
  return guarded([&] {
    const std::string path = &require(path_utf8, "path_utf8");
    if (count < 1) fail(ErrorCode::kInvalidArgument, "count is 0; at least 1 object is needed");
    const Frame led_to = enumValue<Frame>(frame, kLastFrame, "frame");
    const std::vector<UsdObject> scene = sceneObjects(objects, count);
    const SplatWriteOptions write = writeOptions(options);
    withThreads(objects[0].cloud->context->thread_count,
                [&] { writeUsdScene(scene, led_to, path, write); });
  });
}

StippleStatus stipple_cloud_save_levels(const StippleCloud* const* levels, uint64_t level_count,
                                        const StippleCloud* environment, const char* path_utf8,
                                        const StippleCloudSaveOptions* options) {
  return guarded([&] {
    const std::string path = &require(path_utf8, "path_utf8");
    if (level_count == 0) {
      fail(ErrorCode::kInvalidArgument, "level_count is 0; at least 1 is needed");
    }
    require(levels, "levels");
    const std::vector<const SplatCloud*> clouds = cloudsOf(levels, level_count);
    const SplatWriteOptions write = writeOptions(options);
    withThreads(levels[0]->context->thread_count, [&] {
      writeSplatLevels(clouds, environment != nullptr ? environment->cloud.get() : nullptr, path,
                       write);
    });
  });
}

StippleStatus stipple_format_count(uint64_t* count) {
  return guarded([&] { require(count, "count") = splatFormats().size(); });
}

StippleStatus stipple_format_of_file(const char* path_utf8, uint64_t* index) {
  return guarded([&] {
    const SplatFormat* format = splatFormatOfContent(&require(path_utf8, "path_utf8"));
    const SplatFormat* first = splatFormats().data();
    require(index, "index") =
        format != nullptr ? static_cast<uint64_t>(format - first) : splatFormats().size();
  });
}

StippleStatus stipple_format_info(uint64_t index, StippleFormatInfo* info) {
  return guarded([&] {
    const SplatFormat& format = requireFormat(index);
    StippleFormatInfo out = {};
    out.can_read = format.read != nullptr ? 1 : 0;
    out.can_write = format.write != nullptr ? 1 : 0;
    out.max_sh_degree = static_cast<uint32_t>(format.max_sh_degree);
    out.frame = static_cast<uint32_t>(format.frame);
    out.name = format.name;
    out.title = format.title;
    out.extensions = format.extensions;
    out.keeps_frame = format.keeps.frame ? 1 : 0;
    out.keeps_colour_space = format.keeps.colour_space ? 1 : 0;
    out.keeps_antialias = format.keeps.antialias ? 1 : 0;
    out.holds_times = format.holds_times ? 1 : 0;
    deliver(info, out, "info");
  });
}

StippleStatus stipple_format_estimate(uint64_t index, uint64_t count, uint32_t sh_degree,
                                      const StippleCloudSaveOptions* options, uint64_t* bytes) {
  return guarded([&] {
    const int degree = enumValue<int>(sh_degree, static_cast<uint32_t>(kMaxShDegree), "sh_degree");
    require(bytes, "bytes") =
        estimatedFileBytes(requireFormat(index), count, degree, writeOptions(options));
  });
}

StippleStatus stipple_cloud_transform(const StippleCloud* cloud, const double matrix[16],
                                      StippleCloud** moved) {
  return guarded([&] {
    require(cloud, "cloud");
    require(moved, "moved");
    const Mat4d transform = Eigen::Map<const Mat4d>(&require(matrix, "matrix"));
    *moved = new StippleCloud{
        cloud->context, std::make_shared<const SplatCloud>(transformed(*cloud->cloud, transform))};
  });
}

StippleStatus stipple_cloud_compare(const StippleCloud* a, const StippleCloud* b,
                                    StippleCloudComparison* result) {
  return guarded([&] {
    const SplatCloud& first = *require(a, "a").cloud;
    const SplatCloud& second = *require(b, "b").cloud;
    const CloudComparison made = compare(first, second);
    StippleCloudComparison out = {};
    out.same_order = made.same_order ? 1 : 0;
    out.count_a = first.size();
    out.count_b = second.size();
    out.max_position = made.position.max;
    out.max_rotation = made.rotation.max;
    out.max_scale_ratio = made.scale_ratio.max;
    out.max_opacity = made.opacity.max;
    out.max_sh = made.sh.max;
    out.mean_position = made.position.mean;
    out.mean_rotation = made.rotation.mean;
    out.mean_scale_ratio = made.scale_ratio.mean;
    out.mean_opacity = made.opacity.mean;
    out.mean_sh = made.sh.mean;
    deliver(result, out, "result");
  });
}

}  // extern "C"
