#include <algorithm>
#include <cstddef>

#include "api/camera.h"
#include "api/guard.h"
#include "api/handles.h"
#include "base/parallel.h"
#include "data/views/rgba_picture.h"
#include "data/views/view_colour.h"
#include "io/views/dataset.h"

using namespace stipple;
using namespace stipple::api;

namespace {

// Decoded, without distortion, and made smaller: three times four channels of float32.
constexpr uint64_t kBytesPerPixelRead = 48;

StippleViewsOpenOptions openDefaults() {
  StippleViewsOpenOptions options = {};
  options.struct_size = sizeof(options);
  options.downscale = DatasetOptions().downscale;
  options.cache_bytes = DatasetOptions().cache_bytes;
  const SeriesOptions series;
  options.frame_rate = series.frame_rate;
  options.first_frame = series.first_frame;
  options.last_frame = series.last_frame;
  options.frame_step = series.frame_step;
  options.max_images = series.max_images;
  return options;
}

SeriesOptions seriesFrom(const StippleViewsOpenOptions& given) {
  SeriesOptions series;
  series.with_frames = given.with_frames != 0;
  series.frame_rate = given.frame_rate;
  series.first_frame = given.first_frame;
  series.last_frame = given.last_frame;
  series.frame_step = given.frame_step;
  series.max_images = given.max_images;
  if (given.held_out_cameras_utf8) series.held_out_cameras = given.held_out_cameras_utf8;
  return series;
}

/// The views to change; a copy, which shares the pictures, where a job holds a share of them.
MemoryViewSource& writable(StippleViews& views) {
  if (!views.memory) {
    fail(ErrorCode::kInvalidArgument,
         "views come from a file; only those of stipple_views_create can be added to");
  }
  views.source.reset();
  if (views.memory.use_count() > 1) {
    views.memory = std::make_shared<MemoryViewSource>(*views.memory);
  }
  views.source = views.memory;
  return *views.memory;
}

std::vector<bool> movingFrom(const uint8_t* moving, size_t count) {
  std::vector<bool> moves(moving ? count : 0);
  for (size_t i = 0; i < moves.size(); ++i) moves[i] = moving[i] != 0;
  return moves;
}

template <class T>
std::vector<T> copied(const T* values, size_t count) {
  return values ? std::vector<T>(values, values + count) : std::vector<T>();
}

ViewPicture pictureFrom(const StippleViewImage& given, const Camera& camera) {
  ViewPicture picture;
  picture.width = camera.width;
  picture.height = camera.height;
  const size_t pixels = size_t{camera.width} * camera.height;
  takeRgba(&require(given.rgba, "image->rgba"), picture);
  picture.weights = copied(given.weights, pixels);
  picture.depth = copied(given.depth, pixels);
  forgetEmptyDepth(picture);
  picture.normals = copied(given.normals, pixels * 3);
  return picture;
}

/// In: pixels, of the image.
ViewFacts factsFrom(const StippleViewImage& given, const std::string& name, size_t pixels) {
  return {.name = name,
          .time = given.time,
          .role = static_cast<ViewRole>(enumValue<StippleViewSplit>(
              given.split, STIPPLE_VIEW_SPLIT_VALIDATION, "image->split")),
          .camera_name = given.camera_utf8 ? given.camera_utf8 : "",
          .moving = movingFrom(given.moving, pixels)};
}

/// What is known of the views of a data set; each must be readable within the memory limit.
void noteDataset(const Dataset& dataset, StippleViews& views) {
  for (size_t i = 0; i < dataset.count(); ++i) {
    const DatasetView& source = dataset.source(i);
    const Camera& seen_by = source.view.camera;
    views.context->requireMemory(uint64_t{seen_by.width} * seen_by.height * kBytesPerPixelRead,
                                 ("reading " + source.image_path).c_str());
    ViewNote note;
    note.name = dataset.name(i);
    note.image_path = source.image_path;
    note.camera_model = source.view.camera_model.c_str();
    note.split = static_cast<StippleViewSplit>(dataset.role(i));
    note.source_width = seen_by.width;
    note.source_height = seen_by.height;
    note.is_distorted = source.view.lens.isDistorted();
    note.time = dataset.time(i);
    views.notes.push_back(std::move(note));
  }
}

/// Values to a buffer of the caller, or `otherwise` where nothing is known.
void give(const std::vector<float>& values, size_t count, float otherwise, float* out) {
  if (!out) return;
  if (values.empty()) {
    std::fill_n(out, count, otherwise);
  } else {
    std::copy(values.begin(), values.end(), out);
  }
}

}  // namespace

extern "C" {

void stipple_views_open_options_init(StippleViewsOpenOptions* options) {
  if (options) *options = openDefaults();
}

StippleStatus stipple_views_open(StippleContext* context, const char* path_utf8,
                                 const StippleViewsOpenOptions* options, StippleViews** views) {
  return guarded([&] {
    require(context, "context");
    require(views, "views");
    const std::string path = &require(path_utf8, "path_utf8");
    const StippleViewsOpenOptions given = completed(options, openDefaults(), "options");
    const ContextState& state = *context->state;
    DatasetOptions asked;
    asked.downscale = given.downscale;
    asked.series = seriesFrom(given);
    asked.cache_bytes = std::min(given.cache_bytes, state.memory_limit_bytes / 4);
    std::shared_ptr<const Dataset> dataset;
    withThreads(state.thread_count, [&] { dataset = openDataset(path, asked); });
    auto made = std::make_unique<StippleViews>();
    made->context = context->state;
    noteDataset(*dataset, *made);
    made->series = dataset->series();
    made->source = std::move(dataset);
    *views = made.release();
  });
}

StippleStatus stipple_views_create(StippleContext* context, uint32_t colour_space,
                                   StippleViews** views) {
  return guarded([&] {
    require(context, "context");
    require(views, "views");
    auto made = std::make_unique<StippleViews>();
    made->context = context->state;
    made->memory =
        std::make_shared<MemoryViewSource>(enumValue<ColourSpace>(colour_space, 1, "colour_space"));
    made->source = made->memory;
    *views = made.release();
  });
}

StippleStatus stipple_views_add(StippleViews* views, const StippleCamera* camera,
                                const StippleViewImage* image, const char* name_utf8) {
  return guarded([&] {
    require(views, "views");
    const Camera seen_by = cameraFrom(camera);
    const StippleViewImage given = completeUpTo(image, offsetof(StippleViewImage, time), "image");
    const Transfer transfer = enumValue<Transfer>(given.transfer, 1, "image->transfer");
    MemoryViewSource& source = writable(*views);
    const std::string name = name_utf8 ? name_utf8 : "view " + std::to_string(views->notes.size());
    // Before the arrays are made: an absurd size is refused as such.
    try {
      validate(seen_by);
      requireImagePlane(seen_by, "fitting");
    } catch (const Error& error) {
      fail(error.code(), name + ": " + error.what());
    }
    constexpr uint64_t kBytesPerPixel = 9 * sizeof(float);
    const uint64_t pixels = uint64_t{seen_by.width} * seen_by.height;
    views->context->requireMemory(pixels * kBytesPerPixel, "the image of a view");
    const ViewFacts facts = factsFrom(given, name, pixels);
    ViewPicture made = pictureFrom(given, seen_by);
    convertColours(made, transfer, source.colourSpace());
    ViewNote note;
    note.name = name;
    note.camera_model = modelName(seen_by);
    note.split = static_cast<StippleViewSplit>(facts.role);
    note.time = facts.time;
    views->notes.push_back(std::move(note));
    try {
      source.add(seen_by, made, facts);
    } catch (...) {
      views->notes.pop_back();
      throw;
    }
  });
}

StippleStatus stipple_views_set_points(StippleViews* views, const StippleViewPoints* points) {
  return guarded([&] {
    MemoryViewSource& source = writable(require(views, "views"));
    const StippleViewPoints given =
        completeUpTo(points, offsetof(StippleViewPoints, times), "points");
    if (given.count > 0) {
      require(given.positions, "points->positions");
      require(given.colours, "points->colours");
    }
    constexpr uint64_t kBytesPerPoint = 11 * sizeof(float) + sizeof(double);
    views->context->requireMemory(
        given.count > UINT64_MAX / kBytesPerPoint ? UINT64_MAX : given.count * kBytesPerPoint,
        "the points of views");
    const size_t count = given.count;
    PointSet made;
    made.positions = copied(given.positions, count * 3);
    made.colours = copied(given.colours, count * 3);
    made.normals = copied(given.normals, count * 3);
    made.weights = copied(given.weights, count);
    made.times = copied(given.times, count);
    made.opacities.assign(count, 1.0f);
    if (given.times) made.times.assign(given.times, given.times + count);
    source.setPoints(std::move(made));
  });
}

StippleStatus stipple_views_info(const StippleViews* views, StippleViewsInfo* info) {
  return guarded([&] {
    const StippleViews& given = require(views, "views");
    StippleViewsInfo out = {};
    out.view_count = given.notes.size();
    out.found_count = given.series.image_count;
    out.camera_count = given.series.camera_count;
    out.frame_count = given.series.frame_count;
    out.time_begin = given.series.time_begin;
    out.time_end = given.series.time_end;
    if (given.source) {
      out.colour_space = static_cast<uint32_t>(given.source->colourSpace());
      out.point_count = given.source->points().size();
      out.has_images = 1;
    }
    deliver(info, out, "info");
  });
}

StippleStatus stipple_views_view_info(const StippleViews* views, uint64_t index,
                                      StippleViewInfo* info) {
  return guarded([&] {
    requireView(require(views, "views"), index);
    const ViewNote& note = views->notes[index];
    StippleViewInfo out = {};
    out.split = note.split;
    out.source_width = note.source_width;
    out.source_height = note.source_height;
    out.is_distorted = note.is_distorted ? 1 : 0;
    out.name = note.name.c_str();
    out.image_path = note.image_path.c_str();
    out.camera_model = note.camera_model;
    out.time = note.time;
    deliver(info, out, "info");
  });
}

StippleStatus stipple_views_read(const StippleViews* views, uint64_t index,
                                 const StippleViewBuffers* buffers) {
  return guarded([&] {
    requireView(require(views, "views"), index);
    const StippleViewBuffers out = complete(buffers, "buffers");
    if (!views->source) {
      fail(ErrorCode::kUnsupported,
           "the views are cameras alone (stipple_views_load); they have no images");
    }
    const Camera& camera = views->source->camera(index);
    const size_t pixels = size_t{camera.width} * camera.height;
    requireCapacity(pixels, out.capacity, "pixels");
    ViewPicture picture;
    withThreads(views->context->thread_count, [&] { picture = views->source->load(index); });
    if (out.rgba) giveRgba(picture, out.rgba);
    give(picture.weights, pixels, 1.0f, out.weights);
    give(picture.depth, pixels, 0.0f, out.depth);
    give(picture.normals, pixels * 3, 0.0f, out.normals);
  });
}

StippleStatus stipple_views_read_points(const StippleViews* views, uint64_t capacity,
                                        float* positions, float* colours) {
  return guarded([&] {
    const StippleViews& given = require(views, "views");
    if (!given.source) return;
    const PointSet& points = given.source->points();
    requireCapacity(points.size(), capacity, "points");
    give(points.positions, points.size() * 3, 0.0f, positions);
    give(points.colours, points.size() * 3, 0.0f, colours);
  });
}

}  // extern "C"
