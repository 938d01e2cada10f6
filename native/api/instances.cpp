#include "api/instances.h"

#include <algorithm>
#include <cstddef>
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

ColourGrade gradeFrom(const StippleGrade& grade, const char* name) {
  const StippleGrade given = complete(&grade, name);
  ColourGrade made;
  std::copy(given.matrix, given.matrix + 9, made.matrix.begin());
  std::copy(given.offset, given.offset + 3, made.offset.begin());
  made.opacity = given.opacity;
  validate(made, name);
  return made;
}

Instances instancesFrom(const StippleInstance* instances, uint64_t count) {
  Instances made;
  if (count == 0) return made;
  // Older and newer callers have shorter and longer structs, which lie that far apart.
  const size_t step = require(instances, "instances").struct_size;
  if (step % alignof(StippleInstance) != 0) {
    failStructSize("instances[0]", step, sizeof(StippleInstance));
  }
  const auto* bytes = reinterpret_cast<const std::byte*>(instances);
  for (uint64_t i = 0; i < count; ++i) {
    const std::string name = "instances[" + std::to_string(i) + "]";
    const auto* entry = reinterpret_cast<const StippleInstance*>(bytes + i * step);
    const StippleInstance given =
        completeUpTo(entry, offsetof(StippleInstance, grade), name.c_str());
    if (entry->struct_size != step) {
      failStructSize(name.c_str(), entry->struct_size, sizeof(StippleInstance));
    }
    const StippleCloud& cloud = require(given.cloud, (name + ".cloud").c_str());
    for (const double value : given.matrix) requireFinite(value, (name + ".matrix").c_str());
    requireFinite(given.time, (name + ".time").c_str());
    SplatInstance placed;
    placed.cloud = cloud.cloud.get();
    placed.holdout = enumValue<uint32_t>(given.holdout, 1, (name + ".holdout").c_str()) == 1;
    placed.values_are_checked = isChecked(cloud);
    placed.object_to_world = Eigen::Map<const Mat4d>(given.matrix);
    if (given.grade) placed.grade = gradeFrom(*given.grade, (name + ".grade").c_str());
    made.shares.push_back(cloud.cloud);
    made.list.push_back(placed);
  }
  return made;
}

}  // namespace stipple::api
