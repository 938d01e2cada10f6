#include "fit/registration/picture_registration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "data/views/view_resample.h"
#include "fit/registration/moving_template.h"
#include "fit/registration/picture_loss.h"
#include "mesh/adapt/unfold.h"
#include "train/backend/backend_factory.h"

namespace stipple {

namespace {

/// The published factor of what outlines say: there is little of it beside what the inside says.
constexpr double kOutlineWeight = 3.0;
constexpr uint32_t kSmallestSide = 16, kLargestSide = 4096;

[[noreturn]] void refuse(const std::string& message) {
  fail(ErrorCode::kInvalidArgument, message);
}

/// The template's middle to that of the ball, and its root mean square radius to 1: a ball keeps
/// its size.
Similarity sizeAlignment(const MovingTemplate& moving) {
  const std::vector<Vec3d>& positions = moving.merged().positions;
  Vec3d middle = Vec3d::Zero();
  for (const Vec3d& p : positions) middle += p;
  middle /= static_cast<double>(positions.size());
  double squared = 0;
  for (const Vec3d& p : positions) squared += (p - middle).squaredNorm();
  const double radius = std::sqrt(squared / static_cast<double>(positions.size()));
  Similarity made;
  made.scale = radius > 0 ? 1.0 / radius : 1.0;
  made.offset = -made.scale * middle;
  return made;
}

}  // namespace

RegisteredMesh registerToPictures(const TriMesh& given, const ViewSource& views,
                                  const RegistrationOptions& options,
                                  const BackendFactory& backends, Progress* progress,
                                  RegistrationWatch* watch) {
  validate(options);
  validate(given);
  if (!options.landmarks.empty())
    refuse("landmarks are for targets with a surface, not for images");
  if (options.lands_on_target) refuse("images have no surface that vertices could land on");
  if (options.alignment != PreAlignment::kNone && options.alignment != PreAlignment::kSize) {
    refuse("images align a template by size, or not at all; nothing in them says a turn before");
  }
  if (options.picture_side < kSmallestSide || options.picture_side > kLargestSide) {
    refuse("the longer side of images is " + std::to_string(options.picture_side) +
           " pixels; 16 to 4096 are allowed");
  }
  std::vector<TargetPicture> pictures = targetPictures(views, options.picture_side, progress);
  MovingTemplate moving(given, ballOfPictures(pictures));
  const UnitBall& ball = moving.ball();
  RegisteredMesh made;
  RegistrationReport& report = made.report;
  moving.report(report);
  const auto inMetres = [&](std::span<const Vec3d> places) {
    std::vector<Vec3d> metres(places.begin(), places.end());
    for (Vec3d& p : metres) p = ball.outOf(p);
    return metres;
  };
  const std::vector<Vec3d> as_given = inMetres(moving.merged().positions);
  if (options.alignment == PreAlignment::kSize) moving.align(sizeAlignment(moving));
  PictureLoss loss(std::move(pictures), moving.links());
  report.picture_before = loss.at(as_given);
  if (options.picture_drawing == PictureDrawing::kSplats) {
    loss.drawSplats(backends, inMetres(moving.merged().positions));
  }
  MeshAdapter adapter(moving.links(), moving.merged().positions, options.adapter);
  std::vector<Vec3d> by_metres(moving.links().vertexCount());
  report.loss = takeSteps(
      moving, adapter, options.adapter.steps,
      [&](uint32_t, std::span<Vec3d> gradient) {
        std::fill(by_metres.begin(), by_metres.end(), Vec3d::Zero());
        const double value =
            loss.addGradient(inMetres(adapter.positions()), kOutlineWeight, by_metres);
        for (size_t v = 0; v < gradient.size(); ++v) gradient[v] += ball.radius * by_metres[v];
        return value;
      },
      progress, watch);
  report.step_count = adapter.stepCount();
  std::vector<Vec3d> places(adapter.positions().begin(), adapter.positions().end());
  unfold(moving.links(), places);
  report.picture_after = loss.at(inMetres(places));
  made.mesh = moving.mesh(places);
  advance(progress, 1.0, kAdaptingStage);
  return made;
}

uint64_t pictureRegistrationMemoryBound(const TriMesh& given, const ViewSource& views,
                                        const RegistrationOptions& options,
                                        const BackendFactory& backends) {
  // Four floats of the target; drawn, plain and derivatives in double, a triangle and a depth;
  // two outlines at most.
  constexpr uint64_t kPixelBytes = 16 + 3 * 32 + 12 + 2 * 72;
  constexpr uint64_t kTriangleBytes = 120, kVertexBytes = 48, kMeshBytes = 400;
  uint64_t bytes = meshAdapterMemoryBound(given.vertexCount(), given.triangleCount()) +
                   kMeshBytes * given.triangleCount();
  SplatCloud splats;
  if (options.picture_drawing == PictureDrawing::kSplats) {
    splats.resize(BoundSplats::countBound(given.triangleCount()));
  }
  uint64_t of_splats = 0;
  for (size_t i = 0; i < views.count(); ++i) {
    const Camera& camera = views.camera(i);
    const double longer = std::max(camera.width, camera.height);
    const double factor = std::min(1.0, options.picture_side / std::max(longer, 1.0));
    bytes += static_cast<uint64_t>(kPixelBytes * factor * factor * camera.width * camera.height) +
             kTriangleBytes * given.triangleCount() + kVertexBytes * given.vertexCount();
    if (splats.size() > 0) {
      const auto scaled = [&](uint32_t side) { return static_cast<uint32_t>(factor * side) + 1; };
      of_splats = std::max(
          of_splats,
          backends.passMemory(splats, resized(camera, scaled(camera.width), scaled(camera.height)),
                              boundSplatsDrawing()));
    }
  }
  constexpr uint64_t kSplatBytes = 2 * 14 * 4;  // a cloud, and its derivatives
  return bytes + of_splats + kSplatBytes * splats.size();
}

}  // namespace stipple
