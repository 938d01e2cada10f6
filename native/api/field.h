#pragma once

#include <string>
#include <variant>

#include "api/handles.h"
#include "io/assets/octree_tensors.h"

namespace stipple::api {

/// The learned field that a model is, or null.
inline const FieldSource* fieldOf(const ModelParts& parts) {
  return std::get_if<FieldSource>(&parts.source);
}

/// The arrays of a density, for an asset.
OctreeTensors octreeOf(const OctreeDensity& density);

ModelParts loadField(const std::string& path);
void saveField(const FieldSource& source, const ModelNotes& notes, const std::string& path);

}  // namespace stipple::api
