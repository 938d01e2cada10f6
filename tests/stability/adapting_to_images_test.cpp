#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "bad_shapes.h"
#include "base/error.h"
#include "fit/mesh_images.h"
#include "fit/registration/picture_registration.h"
#include "train/backend/backend_factory.h"

// The same templates, and what cameras may show of them, with traps on.

namespace stipple {
namespace {

RegistrationOptions quick(PictureDrawing drawing) {
  RegistrationOptions options;
  options.adapter.steps = 12;
  options.adapter.density = MeshDensity::kAdaptive;
  options.picture_drawing = drawing;
  return options;
}

MemoryViewSource ballImages() {
  const AdaptShape ball = sphere(3);
  return imagesOf(ball.positions, ball.triangles, 5, 24);
}

TEST(AdaptingToImages, TemplatesOfBadShapeStayFinite) {
  const MemoryViewSource views = ballImages();
  for (const BadShape& bad : badShapes()) {
    SCOPED_TRACE(bad.name);
    AdaptShape shape = sphere(2);
    bad.change(shape);
    const TriMesh given = meshWithNormals(shape);
    for (const PictureDrawing drawing : {PictureDrawing::kTriangles, PictureDrawing::kSplats}) {
      for (const PreAlignment alignment : {PreAlignment::kNone, PreAlignment::kSize}) {
        RegistrationOptions options = quick(drawing);
        options.alignment = alignment;
        const RegisteredMesh made = registerToPictures(given, views, options, *cpuBackends());
        EXPECT_EQ(made.mesh.triangles, given.triangles);
        requireFinite(made.mesh);
      }
    }
  }
}

TEST(AdaptingToImages, StrengthsAndStepsThatAreFarTooLargeStayFinite) {
  const MemoryViewSource views = ballImages();
  for (const PictureDrawing drawing : {PictureDrawing::kTriangles, PictureDrawing::kSplats}) {
    for (const double strength : {0.0, 1e6}) {
      for (const double step_size : {1e-300, 0.05, 10.0}) {
        RegistrationOptions options = quick(drawing);
        options.adapter.strength = strength;
        options.adapter.step_size = step_size;
        const TriMesh given = meshWithNormals(sphere(2));
        requireFinite(registerToPictures(given, views, options, *cpuBackends()).mesh);
      }
    }
  }
}

/// Cameras inside of the template, ones that see nothing of it, and orthographic ones.
TEST(AdaptingToImages, CamerasAnywhereGiveFiniteDerivatives) {
  const MemoryViewSource views = ballImages();
  for (const PictureDrawing drawing : {PictureDrawing::kTriangles, PictureDrawing::kSplats}) {
    for (const double size : {0.01, 1.0, 3.45, 3.5, 30.0}) {
      AdaptShape shape = sphere(2);
      for (Vec3d& p : shape.positions) p = size * p + Vec3d(0.01, 0, 0);
      const TriMesh given = meshWithNormals(shape);
      requireFinite(registerToPictures(given, views, quick(drawing), *cpuBackends()).mesh);
    }
    MemoryViewSource flat(ColourSpace::kLinear);
    for (size_t i = 0; i < views.count(); ++i) {
      Camera camera = views.camera(i);
      camera.model = CameraModel::kOrthographic;
      camera.fx = camera.fy = 8;
      flat.add(camera, views.load(i));
    }
    const TriMesh given = meshWithNormals(sphere(2));
    requireFinite(registerToPictures(given, flat, quick(drawing), *cpuBackends()).mesh);
  }
}

}  // namespace
}  // namespace stipple
