#include "api/instances.h"

#include <string>

#include "api/guard.h"
#include "api/handles.h"

namespace stipple::api {

namespace {

/// Reads the values of a cloud once in its life. One that is not valid is left to whoever draws it,
/// who says what is wrong.
bool isChecked(const StippleCloud& cloud) {
  if (cloud.is_checked.load(std::memory_order_relaxed)) return true;
  const SplatCloud& splats = *cloud.cloud;
  validateSizes(splats, "cloud");
  if (!rowsAreValid(splats, 0, splats.size())) return false;
  cloud.is_checked.store(true, std::memory_order_relaxed);
  return true;
}

}  // namespace

Instances instancesFrom(const StippleInstance* instances, uint64_t count) {
  Instances made;
  if (count == 0) return made;
  require(instances, "instances");
  for (uint64_t i = 0; i < count; ++i) {
    const std::string name = "instances[" + std::to_string(i) + "]";
    const StippleInstance given = complete(instances + i, name.c_str());
    const StippleCloud& cloud = require(given.cloud, (name + ".cloud").c_str());
    for (const double value : given.matrix) requireFinite(value, (name + ".matrix").c_str());
    SplatInstance placed;
    placed.cloud = cloud.cloud.get();
    placed.values_are_checked = isChecked(cloud);
    placed.object_to_world = Eigen::Map<const Mat4d>(given.matrix);
    made.shares.push_back(cloud.cloud);
    made.list.push_back(placed);
  }
  return made;
}

}  // namespace stipple::api
