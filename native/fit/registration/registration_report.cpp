#include "fit/registration/registration_report.h"

#include "fit/registration/moving_template.h"

namespace stipple {

namespace {

/// Samples of a mesh that surfaceDifference() reads.
RegistrationTarget samplesOf(const TriMesh& mesh, const RegistrationOptions& options) {
  return targetOfMesh(mesh, options.report_count, options.seed);
}

ComparedSurface viewOf(const RegistrationTarget& surface) {
  return {surface.points, surface.normals, surface.positions, surface.triangles,
          surface.is_oriented};
}

}  // namespace

void measureRegistration(const TriMesh& given, const RegistrationTarget& target,
                         const RegistrationOptions& options, RegisteredMesh& made,
                         Progress* progress) {
  if (options.report_count > 0) {
    advance(progress, 1.0, "Measuring the mesh");
    made.report.is_measured = true;
    made.report.before = surfaceDifference(viewOf(samplesOf(given, options)), viewOf(target));
    made.report.after = surfaceDifference(viewOf(samplesOf(made.mesh, options)), viewOf(target));
  }
  advance(progress, 1.0, kAdaptingStage);
}

}  // namespace stipple
