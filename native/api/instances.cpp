#include "api/instances.h"

#include <string>

#include "api/guard.h"
#include "api/handles.h"

namespace stipple::api {

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
    placed.object_to_world = Eigen::Map<const Mat4d>(given.matrix);
    made.shares.push_back(cloud.cloud);
    made.list.push_back(placed);
  }
  return made;
}

}  // namespace stipple::api
