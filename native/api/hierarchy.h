#pragma once

#include <memory>
#include <string>
#include <variant>

#include "api/handles.h"

namespace stipple::api {

using Hierarchy = std::shared_ptr<const HierarchyDecoder>;

/// The hierarchy that a model is, or null.
inline const Hierarchy* hierarchyOf(const ModelParts& parts) {
  return std::get_if<Hierarchy>(&parts.source);
}

ModelParts loadHierarchy(const std::string& path);
void saveHierarchy(const HierarchyDecoder& hierarchy, const ModelNotes& notes,
                   const std::string& path);

}  // namespace stipple::api
