#include "fit/registration/register_to.h"

#include "fit/registration/picture_registration.h"

namespace stipple {

RegisteredMesh registerTo(const TriMesh& given, const TargetSource& source,
                          const RegistrationOptions& options, const BackendFactory& backends,
                          Progress* progress, RegistrationWatch* watch) {
  if (source.views) {
    return registerToPictures(given, *source.views, options, backends, progress, watch);
  }
  return registerMesh(given, targetOf(source, options.target_count, options.seed), options,
                      progress, watch);
}

uint64_t registerToMemoryBound(const TriMesh& given, const TargetSource& source,
                               const RegistrationOptions& options, const BackendFactory& backends) {
  return source.views ? pictureRegistrationMemoryBound(given, *source.views, options, backends)
                      : registrationMemoryBound(given, source, options);
}

}  // namespace stipple
