#include "cli/placed_clouds.h"

namespace stipple::cli {

PlacedClouds::PlacedClouds(const Context& context, const std::vector<std::string>& paths) {
  for (const std::string& path : paths) {
    clouds_.push_back(make<Cloud>(stipple_cloud_load, context.get(), path.c_str()));
    auto instance = sized<StippleInstance>();
    instance.cloud = clouds_.back().get();
    for (int i = 0; i < 4; ++i) instance.matrix[i * 5] = 1.0;
    instances_.push_back(instance);
  }
}

}  // namespace stipple::cli
