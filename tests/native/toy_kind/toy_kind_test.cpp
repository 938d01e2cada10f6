// A kind of model that the library does not have goes the whole way of the C header: table, asset
// file, settings, density, decoding over time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stipple/stipple.h>

#include <array>
#include <cmath>
#include <limits>

#include "api/fixtures.h"
#include "api/handles.h"
#include "density/analytic_density.h"
#include "drifting_splats.h"
#include "io/scratch_folder.h"
#include "model/model_kinds.h"

namespace stipple::test {
namespace {

using testing::HasSubstr;

constexpr std::array<float, 3> kVelocity = {0.5f, 0, -0.25f};

class ToyKind : public ScratchFolder {
 protected:
  void SetUp() override {
    ScratchFolder::SetUp();
    STIPPLE_ASSERT_OK(stipple_context_create(nullptr, &context_));
    StippleModel made{context_->state,
                      makeDriftingSplats({kVelocity.begin(), kVelocity.end()}, {1, 3})};
    const std::string file = path("drift.stipple.safetensors");
    STIPPLE_ASSERT_OK(stipple_model_save(&made, file.c_str()));
    STIPPLE_ASSERT_OK(stipple_model_load(context_, file.c_str(), &model_));
  }
  void TearDown() override {
    stipple_model_free(model_);
    stipple_context_free(context_);
    ScratchFolder::TearDown();
  }

  static StippleDecodeOptions at(double time) {
    StippleDecodeOptions options;
    stipple_decode_options_init(&options);
    options.anchor_count = 1000;
    options.time = time;
    return options;
  }
  std::vector<float> positionsOf(const StippleCloud& cloud) const { return cloud.cloud->positions; }
  std::vector<float> decoded(double time) {
    const StippleDecodeOptions options = at(time);
    StippleCloud* cloud = nullptr;
    STIPPLE_EXPECT_OK(stipple_model_decode(model_, &options, &cloud));
    if (!cloud) return {};
    std::vector<float> positions = positionsOf(*cloud);
    stipple_cloud_free(cloud);
    return positions;
  }
  std::vector<float> decodedByJob(double time) {
    const StippleDecodeOptions options = at(time);
    StippleJob* job = nullptr;
    STIPPLE_EXPECT_OK(stipple_model_decode_start(model_, &options, &job));
    STIPPLE_EXPECT_OK(stipple_job_wait(job));
    StippleCloud* cloud = nullptr;
    STIPPLE_EXPECT_OK(stipple_job_cloud(job, &cloud));
    std::vector<float> positions = positionsOf(*cloud);
    stipple_cloud_free(cloud);
    stipple_job_free(job);
    return positions;
  }

  StippleContext* context_ = nullptr;
  StippleModel* model_ = nullptr;
};

TEST_F(ToyKind, IsReadThroughTheTable) {
  EXPECT_STREQ(model_->model->kind(), "drift");
  auto info = sized<StippleModelInfo>();
  STIPPLE_ASSERT_OK(stipple_model_info(model_, &info));
  EXPECT_EQ(info.kind, 1000u);
  EXPECT_STREQ(info.kind_label, "drifting splats");
}

TEST_F(ToyKind, TellsItsSettings) {
  auto settings = sized<StippleModelSettings>();
  STIPPLE_ASSERT_OK(stipple_model_settings(model_, &settings));
  EXPECT_EQ(settings.budget_unit, static_cast<uint32_t>(STIPPLE_BUDGET_ANCHORS));
  EXPECT_EQ(settings.minimum_budget, 1u);
  EXPECT_EQ(settings.maximum_budget, STIPPLE_MAX_ANCHORS);
  EXPECT_EQ(settings.minimum_gaussians_per_anchor, 1u);
  EXPECT_EQ(settings.maximum_gaussians_per_anchor, 1u);
  EXPECT_EQ(settings.has_order, 1u);
  EXPECT_EQ(settings.has_seed, 1u);
  EXPECT_EQ(settings.takes_mask, 0u);
  EXPECT_EQ(settings.has_time, 1u);
  EXPECT_EQ(settings.time_begin, 1);
  EXPECT_EQ(settings.time_end, 3);
}

TEST_F(ToyKind, MovesAsTimePasses) {
  const std::vector<float> before = decoded(0);
  const std::vector<float> begun = decoded(1);
  const std::vector<float> later = decoded(2.5);
  ASSERT_EQ(before.size(), 3000u);
  EXPECT_EQ(before, begun);  // both stand at the beginning
  for (size_t i = 0; i < later.size(); ++i) {
    // Coordinates below 8 are rounded to float32 twice.
    ASSERT_NEAR(later[i] - begun[i], 1.5f * kVelocity[i % 3], 1e-6);
  }
  EXPECT_EQ(decodedByJob(2.5), later);
}

TEST_F(ToyKind, IsAtTimeZeroForCallersWhoseOptionsEndBeforeTime) {
  StippleDecodeOptions options = at(2.5);
  options.struct_size = offsetof(StippleDecodeOptions, time);
  StippleCloud* cloud = nullptr;
  STIPPLE_ASSERT_OK(stipple_model_decode(model_, &options, &cloud));
  EXPECT_EQ(positionsOf(*cloud), decoded(0));
  stipple_cloud_free(cloud);
}

TEST_F(ToyKind, RefusesATimeThatIsNotFinite) {
  for (const double time :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    const StippleDecodeOptions options = at(time);
    StippleCloud* cloud = nullptr;
    EXPECT_EQ(stipple_model_decode(model_, &options, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT);
    EXPECT_THAT(stipple_last_error_message(), HasSubstr("options->time"));
    StippleJob* job = nullptr;
    EXPECT_EQ(stipple_model_decode_start(model_, &options, &job), STIPPLE_ERROR_INVALID_ARGUMENT);
  }
}

TEST_F(ToyKind, ItsDensityIsSampledInItsOwnCube) {
  StippleDensity* density = nullptr;
  STIPPLE_ASSERT_OK(stipple_model_density(model_, &density));
  auto info = sized<StippleDensityInfo>();
  STIPPLE_ASSERT_OK(stipple_density_info(density, &info));
  EXPECT_EQ(info.leaf_level, 6u);
  EXPECT_EQ(info.leaf_count, 0u);  // nobody has counted them
  EXPECT_EQ(info.root_side, 2);
  StippleSampleOptions options;
  stipple_sample_options_init(&options);
  std::vector<float> positions(3 * options.count), log_q(options.count);
  std::vector<uint64_t> leaves(options.count);
  auto buffers = sized<StippleAnchorBuffers>();
  buffers.positions = positions.data();
  buffers.log_q = log_q.data();
  buffers.leaves = leaves.data();
  STIPPLE_ASSERT_OK(stipple_density_sample(density, &options, &buffers));
  for (size_t i = 0; i < positions.size(); ++i) {
    const double low = 1.0 + static_cast<double>(i % 3);
    ASSERT_GE(positions[i], low);
    ASSERT_LE(positions[i], low + 2);
  }
  for (size_t i = 0; i < leaves.size(); ++i) {
    // Six numbers below 8 are rounded to float32, and their sum, below 32, once more.
    ASSERT_NEAR(static_cast<double>(log_q[i]), std::log(AnalyticDensity::mass(leaves[i], 6)),
                6 * 2.4e-7 + 1.9e-6);
  }
  stipple_density_free(density);
}

TEST_F(ToyKind, HasNoSplatsOfItsOwnToLeaveOut) {
  const uint8_t mask = 1;
  StippleModel* kept = nullptr;
  EXPECT_EQ(stipple_model_keep(model_, &mask, 1, &kept), STIPPLE_ERROR_UNSUPPORTED);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("drifting splats"));
}

TEST_F(ToyKind, StandsBesideTheLibrarysOwn) {
  EXPECT_STREQ(modelKind("field").label, "learned field");
  EXPECT_STREQ(modelKind("drift").label, "drifting splats");
}

}  // namespace
}  // namespace stipple::test
