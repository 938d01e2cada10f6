#include "data/clouds/cloud_columns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "base/parallel.h"
#include "splat/random_scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::randomCloud;

/// Room for every column of a cloud, filled with a value that no splat has.
struct Room {
  explicit Room(size_t count) : values(4 + kMaxShColumns, std::vector<float>(count * 4, -77)) {
    columns = {values[0].data(), values[1].data(), values[2].data(), values[3].data(), {}};
    for (size_t k = 0; k < kMaxShColumns; ++k) columns.rest[k] = values[4 + k].data();
  }

  CloudColumns<const float> given() const {
    CloudColumns<const float> result{
        columns.positions, columns.rotations, columns.scales, columns.base, {}};
    std::copy(columns.rest.begin(), columns.rest.end(), result.rest.begin());
    return result;
  }

  std::vector<std::vector<float>> values;
  CloudColumns<float> columns;
};

SplatCloud cloudOfDegree(int degree, size_t count) {
  CloudRecipe recipe;
  recipe.count = count;
  recipe.degree = degree;
  return randomCloud(recipe, 5);
}

TEST(CloudColumns, HoldEachAttributeAndHarmonicInAnArrayOfItsOwn) {
  SplatCloud cloud = cloudOfDegree(1, 2);
  for (size_t i = 0; i < cloud.sh.size(); ++i) cloud.sh[i] = static_cast<float>(i);
  Room room(2);
  readColumns(cloud, room.columns);
  const std::vector<float> base = {0, 1, 2, cloud.opacities[0], 12, 13, 14, cloud.opacities[1]};
  EXPECT_EQ(room.values[3], base);
  const std::vector<float> second(room.columns.rest[1], room.columns.rest[1] + 6);
  EXPECT_EQ(second, (std::vector<float>{6, 7, 8, 18, 19, 20}));
  EXPECT_EQ(room.columns.positions[3], cloud.positions[3]);
  EXPECT_EQ(room.columns.rotations[5], cloud.rotations[5]);
  EXPECT_EQ(room.columns.scales[4], cloud.scales[4]);
}

TEST(CloudColumns, MakeTheSameCloudBitForBitAtAnyNumberOfThreads) {
  // More than one task, and a last block that is not full.
  constexpr size_t kCount = 40003;
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    const SplatCloud cloud = cloudOfDegree(degree, kCount);
    for (const unsigned threads : {1u, 3u}) {
      withThreads(threads, [&] {
        Room room(kCount);
        readColumns(cloud, room.columns);
        const SplatCloud back = cloudFromColumns(room.given(), kCount, degree);
        EXPECT_EQ(back.sh_degree, degree);
        EXPECT_EQ(back.positions, cloud.positions);
        EXPECT_EQ(back.rotations, cloud.rotations);
        EXPECT_EQ(back.scales, cloud.scales);
        EXPECT_EQ(back.opacities, cloud.opacities);
        EXPECT_EQ(back.sh, cloud.sh);
      });
    }
  }
}

TEST(CloudColumns, LeaveOutWhatIsNotWantedAndFillHarmonicsThatAreNotThere) {
  const SplatCloud cloud = cloudOfDegree(0, 3);
  Room room(3);
  CloudColumns<float> wanted;
  wanted.rest[0] = room.columns.rest[0];
  wanted.scales = room.columns.scales;
  readColumns(cloud, wanted);
  for (size_t i = 0; i < 9; ++i) EXPECT_EQ(room.columns.rest[0][i], 0.0f);
  EXPECT_EQ(room.columns.scales[8], cloud.scales[8]);
  EXPECT_EQ(room.columns.positions[0], -77.0f);
  EXPECT_EQ(room.columns.rest[1][0], -77.0f);
}

TEST(CloudColumns, OfNoSplatsAreACloudWithoutSplats) {
  const SplatCloud cloud = cloudFromColumns({}, 0, 3);
  EXPECT_EQ(cloud.size(), 0u);
  EXPECT_EQ(cloud.sh_degree, 3);
  readColumns(cloud, {});
}

}  // namespace
}  // namespace stipple
