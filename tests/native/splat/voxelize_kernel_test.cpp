#include "splat/voxelize_kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "splat/voxelize_cases.h"
#include "splat/voxelize_splat.h"

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
    std::vector<float> density(kBrickVoxelCount);
    std::vector<float> colour(3 * kBrickVoxelCount);
    std::vector<float> expected_density(kBrickVoxelCount);
    std::vector<float> expected_colour(3 * kBrickVoxelCount);
    for (const BrickKey& brick : {BrickKey{0, 0, 0}, BrickKey{1, 2, 1}, BrickKey{-1, 0, 2}}) {
      sumBrickScalar(brick, splats.data(), list.data(), list.size(), expected_density.data(),
                     expected_colour.data());
      for (const NamedBrickKernel& named : brickKernels()) {
        SCOPED_TRACE(named.target);
        named.kernel(brick, splats.data(), list.data(), list.size(), density.data(), colour.data());
        for (size_t i = 0; i < density.size(); ++i) {
          // 1e-5 of the kernel's float arithmetic; and a sample on the rim of a splat, 3e-4 of its
          // largest density, may fall to either side of the cut-off by rounding.
          const auto seen = static_cast<double>(density[i]);
          const auto expected = static_cast<double>(expected_density[i]);
          ASSERT_NEAR(seen, expected, 2e-5 * expected + 2e-2) << i;
          if (expected < 1.0) continue;  // a sample on the rim then moves the colour by 2 %
          for (size_t channel = 0; channel < 3; ++channel) {
            ASSERT_NEAR(colour[i * 3 + channel], expected_colour[i * 3 + channel], 0.02f) << i;
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace stipple
