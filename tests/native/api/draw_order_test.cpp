#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "api/fixtures.h"

// The order of drawing through the C header; the order itself is judged in tests/native/splat.

namespace stipple::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class DrawOrderCalls : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    STIPPLE_ASSERT_OK(stipple_renderer_create(context_, &renderer_));
    // Before the front camera at z = 3: the second splat is nearer.
    const float positions[] = {0, 0, -1, 0, 0, 1};
    const float rotations[] = {1, 0, 0, 0, 1, 0, 0, 0};
    const float scales[] = {1, 2, 3, 4, 5, 6};
    const float opacities[] = {0.5f, 0.25f};
    const float sh[] = {0, 0, 0, 0, 0, 0};
    auto arrays = sized<StippleCloudArrays>();
    arrays.count = 2;
    arrays.positions = positions;
    arrays.rotations = rotations;
    arrays.scales = scales;
    arrays.opacities = opacities;
    arrays.sh = sh;
    STIPPLE_ASSERT_OK(stipple_cloud_create(context_, &arrays, &cloud_));
    for (StippleInstance& instance : instances_) {
      instance = sized<StippleInstance>();
      instance.cloud = cloud_;
      for (int i = 0; i < 4; ++i) instance.matrix[i * 5] = 1.0;
    }
    instances_[1].matrix[11] = 0.5;  // nearer by half a metre
    buffers_ = sized<StippleDrawOrderBuffers>();
    buffers_.capacity = 4;
    buffers_.order = order_;
    buffers_.rows = rows_;
    buffers_.first_rows = first_rows_;
  }
  void TearDown() override {
    stipple_cloud_free(cloud_);
    stipple_renderer_free(renderer_);
    ApiTest::TearDown();
  }

  StippleStatus order(uint64_t count = 2) {
    const StippleCamera camera = frontCamera();
    StippleJob* job = nullptr;
    const StippleStatus started =
        stipple_renderer_order_start(renderer_, instances_, count, &camera, &buffers_, &job);
    if (started != STIPPLE_OK) return started;
    const StippleStatus ended = stipple_job_wait(job);
    stipple_job_free(job);
    return ended;
  }

  StippleRenderer* renderer_ = nullptr;
  StippleCloud* cloud_ = nullptr;
  StippleInstance instances_[2] = {};
  StippleDrawOrderBuffers buffers_ = {};
  uint32_t order_[4] = {};
  float rows_[16] = {};
  uint64_t first_rows_[2] = {10, 10};
};

TEST_F(DrawOrderCalls, OrderInstancesTogether) {
  STIPPLE_ASSERT_OK(order());
  EXPECT_THAT(order_, ElementsAre(0u, 2u, 1u, 3u));
  EXPECT_EQ(rows_[0], 10.0f);
  EXPECT_EQ(rows_[1], 0.0f);
  EXPECT_EQ(rows_[4], 10.0f);
  EXPECT_EQ(rows_[5], 1.0f);
  EXPECT_EQ(rows_[8], 11.0f);
  // Grey, 0.5 of 64: round(65535 sqrt(0.5 / 64)) = 5793 = 22 * 256 + 161 of each channel.
  EXPECT_EQ(rows_[2], 256.0f * 5793 + 22);
  EXPECT_EQ(rows_[3], 65536.0f * 161 + 5793);
  uint64_t bytes = 0;
  STIPPLE_ASSERT_OK(stipple_renderer_order_memory_bound(renderer_, instances_, 2, &bytes));
  EXPECT_GE(bytes, 4u * 32u);
}

TEST_F(DrawOrderCalls, PackGeometry) {
  float geometry[24];
  STIPPLE_ASSERT_OK(stipple_cloud_pack(cloud_, geometry, 2));
  EXPECT_THAT(std::vector<float>(geometry + 12, geometry + 24),
              ElementsAre(0, 0, 1, 0.25f, 1, 0, 0, 0, 4, 5, 6, 0));
  EXPECT_EQ(stipple_cloud_pack(cloud_, geometry, 1), STIPPLE_ERROR_BUFFER_TOO_SMALL);
  EXPECT_EQ(stipple_cloud_pack(cloud_, nullptr, 2), STIPPLE_ERROR_INVALID_ARGUMENT);
}

TEST_F(DrawOrderCalls, RefuseWrongArgumentsBeforeTheJob) {
  buffers_.capacity = 3;
  EXPECT_EQ(order(), STIPPLE_ERROR_BUFFER_TOO_SMALL);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("capacity is 3; 4 splats"));
  buffers_.capacity = 4;
  buffers_.sh_degree_limit = 5;
  EXPECT_EQ(order(), STIPPLE_ERROR_INVALID_ARGUMENT);
  buffers_.sh_degree_limit = 4;
  buffers_.first_rows = nullptr;
  EXPECT_EQ(order(), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("first_rows is NULL"));
  buffers_.first_rows = first_rows_;
  first_rows_[1] = STIPPLE_MAX_DRAW_ROWS;
  EXPECT_EQ(order(), STIPPLE_ERROR_INVALID_ARGUMENT);
  first_rows_[1] = 0;
  instances_[1].matrix[15] = 2;
  EXPECT_EQ(order(), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(order_, ElementsAre(0u, 0u, 0u, 0u)) << "nothing is written";
  instances_[1].matrix[15] = 1;
  STIPPLE_EXPECT_OK(order(0));
  STIPPLE_EXPECT_OK(order());
}

}  // namespace
}  // namespace stipple::test
