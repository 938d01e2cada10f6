#pragma once

#include "fit/registration/registration.h"

namespace stipple {

/// Lets the vertices of a mesh slide along its own surface to where density wants them; the surface
/// stays, its sharp edges and borders included (SlidingSurface). Everything of registerMesh() holds
/// but for what a target does. Options: adapter, of which the density acts in all steps;
/// sharp_angle; report_count, seed. Errors: kInvalidArgument for a template of fewer than four
/// triangles with area, and landmarks; kCancelled.
RegisteredMesh slideOnItself(const TriMesh& given, const RegistrationOptions& options,
                             Progress* progress = nullptr, RegistrationWatch* watch = nullptr);

/// Whether a target is the template itself, bit for bit.
bool isItself(const TriMesh& given, const TriMesh& target);

}  // namespace stipple
