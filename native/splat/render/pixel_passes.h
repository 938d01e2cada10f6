#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "math/vec.h"
#include "splat/render/render.h"
#include "splat/render/scene.h"
#include "splat/render/splat_normal.h"

namespace stipple {

/// Normal and object of one pixel, in double.
class PixelPasses {
 public:
  /// Forgets the pixel before.
  void clear() {
    normal_.setZero();
    weights_.clear();
  }

  /// In: weight of a splat that shows; object 1 + its instance, or 0 to leave that out.
  void add(double weight, const Vec3d& normal, uint32_t object) {
    normal_ += weight * normal;
    if (object == 0) return;
    const auto known = std::find_if(weights_.begin(), weights_.end(),
                                    [&](const auto& entry) { return entry.first == object; });
    if (known != weights_.end()) {
      known->second += weight;
    } else {
      weights_.push_back({object, weight});
    }
  }

  Vec3d normal() const {
    const double length = normal_.norm();
    return length > 0 ? Vec3d(normal_ / length) : Vec3d(0, 0, 0);
  }

  /// In: what the surface weighs.
  uint32_t object(double surface_weight) const {
    uint32_t best = 0;
    double most = surface_weight;
    for (const auto& [object, weight] : weights_) {
      if (weight > most || (best > 0 && weight == most && object < best)) {
        best = object;
        most = weight;
      }
    }
    return best;
  }

  /// Writes pixel `i` of a result that has its arrays.
  template <typename Result>
  void write(const RenderOptions& options, size_t i, double surface_weight, Result& result) const {
    if (options.with_normal) {
      using Number = typename decltype(result.normal)::value_type;
      const Vec3d mean = normal();
      for (size_t k = 0; k < 3; ++k) {
        result.normal[i * 3 + k] = static_cast<Number>(mean[static_cast<Eigen::Index>(k)]);
      }
    }
    if (options.with_objects) result.objects[i] = object(surface_weight);
  }

 private:
  Vec3d normal_ = Vec3d::Zero();
  std::vector<std::pair<uint32_t, double>> weights_;  ///< in the order of their first splats
};

/// What passes show of each splat of a list; empty where none is asked for.
struct PassValues {
  std::vector<Vec3d> normals;
  std::vector<uint32_t> objects;

  /// A splat that shows at the pixel of `passes`.
  void add(double weight, size_t splat, PixelPasses& passes) const {
    if (!objects.empty()) passes.add(weight, normals[splat], objects[splat]);
  }
};

inline bool hasPasses(const RenderOptions& options) {
  return options.with_normal || options.with_objects;
}

/// In: splats, each with its index among all splats of the scene.
template <typename Splat>
PassValues passValues(const PlacedScene& scene, const std::vector<Splat>& splats,
                      const RenderOptions& options) {
  PassValues values;
  if (!hasPasses(options)) return values;
  values.normals.assign(splats.size(), Vec3d::Zero());
  values.objects.resize(splats.size());
  parallelFor(splats.size(), 1024, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const uint32_t index = splats[i].index;
      const PlacedCloud& placed = scene.clouds[cloudOfSplat(scene, index)];
      values.objects[i] = static_cast<uint32_t>(placed.instance) + 1;
      if (!options.with_normal) continue;
      values.normals[i] = splatNormal(scene, placed, index - placed.first_index);
    }
  });
  return values;
}

}  // namespace stipple
