#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "api/fixtures.h"

// The boundary of selections and filled holes; what they select and make is tested in
// tests/addon/test_regions.py.

namespace stipple::test {
namespace {

using ::testing::HasSubstr;

class Regions : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    cloud_ = oneSplat(0.25f, 0.5f, 0.75f);
    stipple_region_init(&region_);
    region_.kind = STIPPLE_REGION_SPHERE;
    region_.radius = 1;
  }
  void TearDown() override {
    stipple_cloud_free(cloud_);
    ApiTest::TearDown();
  }
  void expectInvalid(StippleStatus status, const char* part) {
    EXPECT_EQ(status, STIPPLE_ERROR_INVALID_ARGUMENT);
    EXPECT_THAT(stipple_last_error_message(), HasSubstr(part));
  }

  StippleCloud* cloud_ = nullptr;
  StippleRegion region_ = {};
  uint8_t mask_ = 0;
  uint64_t count_ = 77;
};

TEST_F(Regions, SelectAndCount) {
  STIPPLE_EXPECT_OK(stipple_cloud_select_regions(cloud_, &region_, 1, &mask_, 1, &count_));
  EXPECT_EQ(mask_, 1);
  EXPECT_EQ(count_, 1u);
  region_.operation = STIPPLE_REGION_SUBTRACT;
  STIPPLE_EXPECT_OK(stipple_cloud_select_regions(cloud_, &region_, 1, &mask_, 1, nullptr));
  EXPECT_EQ(mask_, 0);
  // No regions: the selection before, as 0 and 1.
  mask_ = 9;
  STIPPLE_EXPECT_OK(stipple_cloud_select_regions(cloud_, nullptr, 0, &mask_, 1, nullptr));
  EXPECT_EQ(mask_, 1);
}

TEST_F(Regions, NullAndWrongSizesAreRefusedAndNothingIsWritten) {
  mask_ = 5;
  expectInvalid(stipple_cloud_select_regions(nullptr, &region_, 1, &mask_, 1, &count_), "cloud");
  expectInvalid(stipple_cloud_select_regions(cloud_, nullptr, 1, &mask_, 1, &count_), "regions");
  expectInvalid(stipple_cloud_select_regions(cloud_, &region_, 1, nullptr, 1, &count_), "mask");
  expectInvalid(stipple_cloud_select_regions(cloud_, &region_, 1, &mask_, 2, &count_),
                "mask_count is 2; the cloud has 1");
  region_.kind = STIPPLE_REGION_BRUSH;
  region_.point_count = 1;
  expectInvalid(stipple_cloud_select_regions(cloud_, &region_, 1, &mask_, 1, &count_), "points");
  region_.point_count = UINT64_MAX;
  expectInvalid(stipple_cloud_select_regions(cloud_, &region_, 1, &mask_, 1, &count_),
                "at most 65536");
  region_.kind = STIPPLE_REGION_BOX + 1;
  expectInvalid(stipple_cloud_select_regions(cloud_, &region_, 1, &mask_, 1, &count_),
                "kind is 7; 0 to 6");
  region_.kind = STIPPLE_REGION_ALL;
  region_.operation = 5;
  expectInvalid(stipple_cloud_select_regions(cloud_, &region_, 1, &mask_, 1, &count_),
                "operation is 5; 0 to 4");
  region_.operation = 0;
  region_.struct_size = 0;
  expectInvalid(stipple_cloud_select_regions(cloud_, &region_, 1, &mask_, 1, &count_),
                "struct_size");
  EXPECT_EQ(mask_, 5);
  EXPECT_EQ(count_, 77u);
}

TEST_F(Regions, ShorterStructsOfOlderCallersKeepTheDefaults) {
  // A caller whose struct ends before the box: two of its regions lie that close together.
  constexpr size_t kShort = offsetof(StippleRegion, cloud_to_box);
  std::vector<double> room(2 * kShort / sizeof(double));
  for (int i = 0; i < 2; ++i) {
    auto* region = reinterpret_cast<StippleRegion*>(reinterpret_cast<char*>(room.data()) +
                                                    static_cast<size_t>(i) * kShort);
    region->struct_size = kShort;
    region->kind = i == 0 ? STIPPLE_REGION_BOX : STIPPLE_REGION_SPHERE;
    region->operation = i == 0 ? STIPPLE_REGION_SET : STIPPLE_REGION_SUBTRACT;
    region->centre[0] = 9;
    region->radius = 1;
  }
  STIPPLE_EXPECT_OK(stipple_cloud_select_regions(
      cloud_, reinterpret_cast<StippleRegion*>(room.data()), 2, &mask_, 1, nullptr));
  EXPECT_EQ(mask_, 1);  // in the cube -1..1, not in the ball around (9, 0, 0)
}

TEST_F(Regions, PositionsAndColoursAreGiven) {
  std::array<float, 3> position = {7, 7, 7};
  mask_ = 1;
  STIPPLE_EXPECT_OK(
      stipple_cloud_selected_positions(cloud_, &mask_, 1, 1, position.data(), &count_));
  EXPECT_EQ(count_, 1u);
  EXPECT_EQ(position, (std::array<float, 3>{0, 0, 0}));
  STIPPLE_EXPECT_OK(stipple_cloud_selected_positions(cloud_, &mask_, 1, 0, nullptr, &count_));
  EXPECT_EQ(count_, 0u);
  expectInvalid(stipple_cloud_selected_positions(cloud_, &mask_, 1, 1, nullptr, &count_),
                "positions");
  const uint64_t index = 0, beyond = 1;
  std::array<double, 3> colour = {};
  STIPPLE_EXPECT_OK(stipple_region_colours(cloud_, &index, 1, colour.data()));
  EXPECT_NEAR(colour[1], 0.21404114, 1e-6);  // 0.5 of sRGB
  expectInvalid(stipple_region_colours(cloud_, &beyond, 1, colour.data()), "the cloud has 1");
}

TEST_F(Regions, FillRefusesInItsJobWhatIsNoHole) {
  StippleJob* job = nullptr;
  auto report = sized<StippleFillReport>();
  expectInvalid(stipple_cloud_fill_start(cloud_, nullptr, &mask_, 2, &report, &job),
                "mask_count is 2");
  expectInvalid(stipple_cloud_fill_start(cloud_, nullptr, nullptr, 1, &report, &job), "mask");
  EXPECT_EQ(job, nullptr);
  mask_ = 1;
  STIPPLE_ASSERT_OK(stipple_cloud_fill_start(cloud_, nullptr, &mask_, 1, &report, &job));
  expectInvalid(stipple_job_wait(job), "removes all splats");
  StippleCloud* made = nullptr;
  expectInvalid(stipple_job_cloud(job, &made), "has not ended well");
  EXPECT_EQ(report.hole_count, 0u);
  stipple_job_free(job);
}

}  // namespace
}  // namespace stipple::test
