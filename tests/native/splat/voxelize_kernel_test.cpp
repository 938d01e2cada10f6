#include "splat/voxels/voxelize_kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "splat/voxelize_cases.h"
#include "splat/voxels/voxelize_splat.h"

namespace stipple {
namespace {

TEST(BrickKernel, HasTheScalarOneAndAtLeastOneVectorTarget) {
  const std::vector<NamedBrickKernel> kernels = brickKernels();
  ASSERT_GE(kernels.size(), 2u);
  EXPECT_EQ(std::string(kernels.front().target), "scalar");
}

TEST(BrickKernel, EveryTargetSumsAsTheScalarOne) {
  const SplatCloud cloud = randomCloud(200, 5);
  const SplatInstance instance{&cloud, Mat4d::Identity()};
  for (const double low_pass : {0.0, 0.5}) {
    VoxelizeOptions options;
    options.voxel_size = 0.04;  // 0.05 to 1.3 standard deviations: every number of samples
    options.low_pass = low_pass;
    const std::vector<VoxelSplat> splats =
        prepareVoxelSplats({&instance, 1}, options, options.voxel_size, nullptr);
    std::vector<uint32_t> list(splats.size());
    std::iota(list.begin(), list.end(), 0u);
    for (const BrickKey& brick : {BrickKey{0, 0, 0}, BrickKey{1, 2, 1}, BrickKey{-1, 0, 2}}) {
      BrickSums expected = {};
      sumBrickScalar(brick, splats.data(), list.data(), list.size(), expected);
      for (const NamedBrickKernel& named : brickKernels()) {
        SCOPED_TRACE(named.target);
        BrickSums seen = {};
        named.kernel(brick, splats.data(), list.data(), list.size(), seen);
        for (size_t i = 0; i < kBrickVoxelCount; ++i) {
          // 1e-5 of the kernel's float arithmetic; and a sample on the rim of a splat, 3e-4 of its
          // largest density, may fall to either side of the cut-off by rounding.
          const double density = expected[0][i];
          ASSERT_NEAR(seen[0][i], density, 2e-5 * density + 2e-2) << i;
          if (density < 1.0) continue;  // a sample on the rim then moves the colour by 2 %
          for (size_t channel = 1; channel < 4; ++channel) {
            ASSERT_NEAR(seen[channel][i] / seen[0][i], expected[channel][i] / density, 0.02) << i;
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace stipple
