#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cli/library.h"

namespace stipple::cli {

/// The triangles of a mesh in one of its shapes.
struct Shape {
  std::vector<float> positions;     ///< [V,3]
  std::vector<uint32_t> triangles;  ///< [T,3]
};

Shape shapeOf(const Context& context, const std::string& mesh_path);

/// Refuses two shapes that are not of one mesh. In: the files they are of.
void requireOneMesh(const Shape& rest, const std::string& rest_path, const Shape& posed,
                    const std::string& posed_path);

/// How a cloud follows a mesh at rest, with progress. In: reach, StippleBindingReach.
Binding bindingOf(const Cloud& cloud, const Shape& rest, uint32_t reach);

/// The splats that were bound, as the mesh in this shape carries them.
Cloud carriedBy(const Shape& posed, const Cloud& cloud, const Binding& binding);

/// `--around` as a StippleBindingReach.
inline uint32_t reachOf(bool around) {
  return around ? STIPPLE_BIND_AROUND : STIPPLE_BIND_SURFACE;
}

}  // namespace stipple::cli
