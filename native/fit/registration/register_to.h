#pragma once

#include "fit/registration/registration.h"

namespace stipple {

class BackendFactory;

/// Gives a template the shape of whatever its target is: a surface, points or splats
/// (registerMesh()) or images (registerToPictures()). Errors: theirs, and those of targetOf().
RegisteredMesh registerTo(const TriMesh& given, const TargetSource& source,
                          const RegistrationOptions& options, const BackendFactory& backends,
                          Progress* progress = nullptr, RegistrationWatch* watch = nullptr);

/// Bytes at most.
uint64_t registerToMemoryBound(const TriMesh& given, const TargetSource& source,
                               const RegistrationOptions& options, const BackendFactory& backends);

}  // namespace stipple
