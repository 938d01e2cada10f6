#include <cstddef>

#include "api/camera.h"
#include "api/guard.h"
#include "api/handles.h"
#include "data/views/view_resample.h"
#include "io/views/camera_file.h"

namespace stipple::api {

Camera cameraFrom(const StippleCamera* camera) {
  const StippleCamera given =
      completeUpTo(camera, offsetof(StippleCamera, field_of_view), "camera");
  Camera made;
  made.model = enumValue<CameraModel>(given.model, 4, "camera->model");
  made.width = given.width;
  made.height = given.height;
  made.fx = given.fx;
  made.fy = given.fy;
  made.cx = given.cx;
  made.cy = given.cy;
  made.world_to_camera = Eigen::Map<const Mat4d>(given.world_to_camera);
  made.near_plane = given.near_plane;
  made.far_plane = given.far_plane;
  made.field_of_view = given.field_of_view;
  return made;
}

StippleCamera cameraTo(const Camera& camera) {
  StippleCamera out = {};
  out.model = static_cast<uint32_t>(camera.model);
  out.width = camera.width;
  out.height = camera.height;
  out.fx = camera.fx;
  out.fy = camera.fy;
  out.cx = camera.cx;
  out.cy = camera.cy;
  Eigen::Map<Mat4d>(out.world_to_camera) = camera.world_to_camera;
  out.near_plane = camera.near_plane;
  out.far_plane = camera.far_plane;
  out.field_of_view = camera.field_of_view;
  return out;
}

void requireView(const StippleViews& views, uint64_t index) {
  if (index < views.notes.size()) return;
  fail(ErrorCode::kInvalidArgument, "view " + std::to_string(index) + " was asked for; there are " +
                                        std::to_string(views.notes.size()) +
                                        " views, counted from 0");
}

}  // namespace stipple::api

using namespace stipple;
using namespace stipple::api;

namespace {

void noteCameras(StippleViews& views) {
  for (const CameraView& view : views.cameras) {
    ViewNote note;
    note.name = view.image_path;
    note.camera_model = modelName(view.camera);
    note.source_width = view.camera.width;
    note.source_height = view.camera.height;
    note.time = view.time;
    views.notes.push_back(std::move(note));
  }
}

}  // namespace

extern "C" {

StippleStatus stipple_views_load(StippleContext* context, const char* path_utf8,
                                 StippleViews** views) {
  return guarded([&] {
    require(context, "context");
    require(views, "views");
    const std::string path = &require(path_utf8, "path_utf8");
    auto made = std::make_unique<StippleViews>();
    made->context = context->state;
    made->cameras = readCameraFile(path);
    noteCameras(*made);
    *views = made.release();
  });
}

void stipple_views_free(StippleViews* views) {
  delete views;
}

StippleStatus stipple_views_count(const StippleViews* views, uint64_t* count) {
  return guarded([&] { require(count, "count") = require(views, "views").notes.size(); });
}

StippleStatus stipple_views_camera(const StippleViews* views, uint64_t index,
                                   StippleCamera* camera) {
  return guarded([&] {
    requireView(require(views, "views"), index);
    deliver(camera,
            cameraTo(views->source ? views->source->camera(index) : views->cameras[index].camera),
            "camera");
  });
}

StippleStatus stipple_camera_resize(StippleCamera* camera, uint32_t width, uint32_t height) {
  return guarded([&] {
    require(camera, "camera");
    if (width < 1 || height < 1) {
      fail(ErrorCode::kInvalidArgument, "the new size is " + std::to_string(width) + " x " +
                                            std::to_string(height) +
                                            "; each side must be at least 1");
    }
    deliver(camera, cameraTo(resized(cameraFrom(camera), width, height)), "camera");
  });
}

}  // extern "C"
