#include <gtest/gtest.h>
#include <stipple/stipple.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "api/fixtures.h"

namespace stipple::test {
namespace {

class HierarchyApi : public ApiTest {
 protected:
  StippleCloud* cloudOf(uint64_t count) {
    std::vector<float> positions, rotations, scales, opacities, sh;
    for (uint64_t i = 0; i < count; ++i) {
      const float t = static_cast<float>(i) / static_cast<float>(count);
      positions.insert(positions.end(), {t, t * t, 1 - t});
      rotations.insert(rotations.end(), {1, 0, 0, 0});
      scales.insert(scales.end(), {0.02f, 0.01f, 0.03f});
      opacities.push_back(0.2f + 0.5f * t);
      sh.insert(sh.end(), {t, 0.5f, -t});
    }
    auto arrays = sized<StippleCloudArrays>();
    arrays.count = count;
    arrays.positions = positions.data();
    arrays.rotations = rotations.data();
    arrays.scales = scales.data();
    arrays.opacities = opacities.data();
    arrays.sh = sh.data();
    StippleCloud* cloud = nullptr;
    EXPECT_EQ(stipple_cloud_create(context_, &arrays, &cloud), STIPPLE_OK);
    return cloud;
  }

  StippleModel* modelOf(const StippleCloud* cloud) {
    StippleModelFromCloudOptions options;
    stipple_model_from_cloud_options_init(&options);
    options.view_count = 4;
    options.view_size = 64;
    StippleJob* job = nullptr;
    EXPECT_EQ(stipple_model_from_cloud_start(context_, cloud, &options, &job), STIPPLE_OK);
    EXPECT_EQ(stipple_job_wait(job), STIPPLE_OK);
    StippleModel* model = nullptr;
    EXPECT_EQ(stipple_job_model(job, &model), STIPPLE_OK);
    stipple_job_free(job);
    return model;
  }

  uint64_t countAt(const StippleModel* model, uint64_t budget) {
    StippleDecodeOptions options;
    stipple_decode_options_init(&options);
    options.anchor_count = budget;
    StippleCloud* cut = nullptr;
    EXPECT_EQ(stipple_model_decode(model, &options, &cut), STIPPLE_OK);
    auto info = sized<StippleCloudInfo>();
    EXPECT_EQ(stipple_cloud_info(cut, &info), STIPPLE_OK);
    stipple_cloud_free(cut);
    return info.count;
  }
};

TEST_F(HierarchyApi, DecodesAnExistingCloudAtAnyBudget) {
  StippleCloud* cloud = cloudOf(200);
  StippleModel* model = modelOf(cloud);
  auto info = sized<StippleModelInfo>();
  STIPPLE_ASSERT_OK(stipple_model_info(model, &info));
  EXPECT_EQ(info.kind, STIPPLE_MODEL_HIERARCHY);
  EXPECT_EQ(info.leaf_count, 200u);
  for (const uint64_t budget : {1u, 2u, 77u, 200u}) EXPECT_EQ(countAt(model, budget), budget);

  const std::string path =
      (std::filesystem::temp_directory_path() / "hierarchy_api.stipple.safetensors").string();
  STIPPLE_ASSERT_OK(stipple_model_save(model, path.c_str()));
  StippleModel* loaded = nullptr;
  STIPPLE_ASSERT_OK(stipple_model_load(context_, path.c_str(), &loaded));
  std::filesystem::remove(path);
  EXPECT_EQ(countAt(loaded, 33), 33u);

  StippleDecodeOptions options;
  stipple_decode_options_init(&options);
  StippleCloud* none = nullptr;
  options.anchor_count = 201;
  EXPECT_EQ(stipple_model_decode(model, &options, &none), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(stipple_last_error_message()).find("200"), std::string::npos);
  options.anchor_count = 100;
  options.gaussians_per_anchor = 2;
  EXPECT_EQ(stipple_model_decode(model, &options, &none), STIPPLE_ERROR_INVALID_ARGUMENT);
  StippleDensity* density = nullptr;
  EXPECT_EQ(stipple_model_density(model, &density), STIPPLE_ERROR_UNSUPPORTED);
  stipple_model_free(loaded);
  stipple_model_free(model);
  stipple_cloud_free(cloud);
}

TEST_F(HierarchyApi, RefinesACutAndKeepsItsCount) {
  StippleCloud* cloud = cloudOf(120);
  StippleModel* model = modelOf(cloud);
  StippleDecodeOptions decode;
  stipple_decode_options_init(&decode);
  decode.anchor_count = 40;
  StippleCloud* cut = nullptr;
  STIPPLE_ASSERT_OK(stipple_model_decode(model, &decode, &cut));
  StippleRefineOptions options;
  stipple_refine_options_init(&options);
  options.iterations = 3;
  options.view_count = 2;
  options.view_size = 48;
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_cloud_refine_start(cut, cloud, &options, &job));
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  StippleCloud* refined = nullptr;
  STIPPLE_ASSERT_OK(stipple_job_cloud(job, &refined));
  auto info = sized<StippleCloudInfo>();
  STIPPLE_ASSERT_OK(stipple_cloud_info(refined, &info));
  EXPECT_EQ(info.count, 40u);
  options.view_count = 0;
  StippleJob* never = nullptr;
  EXPECT_EQ(stipple_cloud_refine_start(cut, cloud, &options, &never),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  stipple_job_free(job);
  stipple_cloud_free(refined);
  stipple_cloud_free(cut);
  stipple_model_free(model);
  stipple_cloud_free(cloud);
}

TEST_F(HierarchyApi, RefusesBadInput) {
  StippleCloud* empty = cloudOf(0);
  StippleJob* job = nullptr;
  EXPECT_EQ(stipple_model_from_cloud_start(context_, empty, nullptr, &job),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  StippleCloud* cloud = cloudOf(5);
  StippleModelFromCloudOptions options;
  stipple_model_from_cloud_options_init(&options);
  options.view_rig = 3;
  EXPECT_EQ(stipple_model_from_cloud_start(context_, cloud, &options, &job),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  options.view_rig = 0;
  options.footprint = -1;
  EXPECT_EQ(stipple_model_from_cloud_start(context_, cloud, &options, &job),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(stipple_model_from_cloud_start(context_, nullptr, nullptr, &job),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  stipple_cloud_free(empty);
  stipple_cloud_free(cloud);
}

}  // namespace
}  // namespace stipple::test
