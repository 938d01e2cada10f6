#include <gtest/gtest.h>
#include <stipple/stipple.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <thread>
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

  StippleCloud* cutOf(const StippleModel* model, uint64_t budget) {
    StippleDecodeOptions options;
    stipple_decode_options_init(&options);
    options.anchor_count = budget;
    StippleCloud* cut = nullptr;
    EXPECT_EQ(stipple_model_decode(model, &options, &cut), STIPPLE_OK);
    return cut;
  }

  uint64_t countAt(const StippleModel* model, uint64_t budget) {
    StippleCloud* cut = cutOf(model, budget);
    auto info = sized<StippleCloudInfo>();
    EXPECT_EQ(stipple_cloud_info(cut, &info), STIPPLE_OK);
    stipple_cloud_free(cut);
    return info.count;
  }

  /// Every number of a cloud of degree 0.
  std::vector<float> valuesOf(const StippleCloud* cloud) {
    auto info = sized<StippleCloudInfo>();
    EXPECT_EQ(stipple_cloud_info(cloud, &info), STIPPLE_OK);
    std::vector<float> values(info.count * 14);
    auto buffers = sized<StippleCloudBuffers>();
    buffers.capacity = info.count;
    buffers.positions = values.data();
    buffers.rotations = buffers.positions + info.count * 3;
    buffers.scales = buffers.rotations + info.count * 4;
    buffers.opacities = buffers.scales + info.count * 3;
    buffers.sh = buffers.opacities + info.count;
    EXPECT_EQ(stipple_cloud_read(cloud, &buffers), STIPPLE_OK);
    return values;
  }

  /// Cancels a job that has begun, and takes it to its end.
  void expectCancelled(StippleJob* job) {
    auto progress = sized<StippleJobProgress>();
    EXPECT_EQ(stipple_job_poll(job, &progress), STIPPLE_OK);
    EXPECT_EQ(progress.state, static_cast<uint32_t>(STIPPLE_JOB_RUNNING));
    EXPECT_EQ(stipple_job_cancel(job), STIPPLE_OK);
    EXPECT_EQ(stipple_job_wait(job), STIPPLE_ERROR_CANCELLED);
    EXPECT_EQ(stipple_job_poll(job, &progress), STIPPLE_OK);
    EXPECT_EQ(progress.state, static_cast<uint32_t>(STIPPLE_JOB_CANCELLED));
  }

  /// Waits until a job that runs has done a share of its work.
  void waitFor(StippleJob* job, double fraction) {
    auto progress = sized<StippleJobProgress>();
    do {
      ASSERT_EQ(stipple_job_poll(job, &progress), STIPPLE_OK);
      std::this_thread::yield();
    } while (progress.fraction < fraction && progress.state == STIPPLE_JOB_RUNNING);
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

  const std::string path = (std::filesystem::temp_directory_path() /
                            ("hierarchy" + std::to_string(getpid()) + ".stipple.safetensors"))
                               .string();
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

TEST_F(HierarchyApi, RefusesPicturesBeyondTheMemoryLimitBeforeItBegins) {
  auto limits = sized<StippleContextOptions>();
  limits.memory_limit_bytes = uint64_t{1} << 30;
  StippleContext* small = nullptr;
  STIPPLE_ASSERT_OK(stipple_context_create(&limits, &small));
  std::swap(small, context_);
  StippleCloud* cloud = cloudOf(200);
  StippleJob* job = nullptr;
  // 4096 pictures of 800 x 800 pixels, 12 bytes each, are 31 GB.
  StippleRefineOptions refine;
  stipple_refine_options_init(&refine);
  refine.view_count = 4096;
  EXPECT_EQ(stipple_cloud_refine_start(cloud, cloud, &refine, &job), STIPPLE_ERROR_MEMORY_LIMIT);
  EXPECT_NE(std::string(stipple_last_error_message()).find("the memory limit is 1.00 GiB"), std::string::npos);
  // A picture of 65536 x 65536 pixels is 69 GB.
  StippleModelFromCloudOptions options;
  stipple_model_from_cloud_options_init(&options);
  options.view_size = 65536;
  EXPECT_EQ(stipple_model_from_cloud_start(context_, cloud, &options, &job),
            STIPPLE_ERROR_MEMORY_LIMIT);
  EXPECT_EQ(job, nullptr);
  refine.view_count = 2;
  refine.view_size = 48;
  refine.iterations = 1;
  STIPPLE_ASSERT_OK(stipple_cloud_refine_start(cloud, cloud, &refine, &job));
  STIPPLE_EXPECT_OK(stipple_job_wait(job));
  stipple_job_free(job);
  stipple_cloud_free(cloud);
  std::swap(small, context_);
  stipple_context_free(small);
}

TEST_F(HierarchyApi, ACancelledBuildLosesNothing) {
  // Pictures that would take minutes, so the job is still at work when it is asked to stop.
  StippleCloud* cloud = cloudOf(2000);
  const std::vector<float> before = valuesOf(cloud);
  StippleModelFromCloudOptions options;
  stipple_model_from_cloud_options_init(&options);
  options.view_count = 4096;
  options.view_size = 1024;
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_model_from_cloud_start(context_, cloud, &options, &job));
  waitFor(job, 1e-6);
  expectCancelled(job);
  StippleModel* none = nullptr;
  EXPECT_EQ(stipple_job_model(job, &none), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(none, nullptr);
  stipple_job_free(job);

  STIPPLE_ASSERT_OK(stipple_model_from_cloud_start(context_, cloud, &options, &job));
  stipple_job_free(job);  // cancels and waits

  // The cloud is as it was, and a tree can still be made of it.
  StippleModel* model = modelOf(cloud);
  EXPECT_EQ(countAt(model, 700), 700u);
  StippleCloud* all = cutOf(model, 2000);
  EXPECT_EQ(valuesOf(all), before);
  stipple_cloud_free(all);
  stipple_model_free(model);
  stipple_cloud_free(cloud);
}

TEST_F(HierarchyApi, ACancelledRefinementLosesNothing) {
  StippleCloud* cloud = cloudOf(2000);
  StippleModel* model = modelOf(cloud);
  StippleCloud* cut = cutOf(model, 500);
  const std::vector<float> before = valuesOf(cut);
  StippleRefineOptions options;
  stipple_refine_options_init(&options);
  options.iterations = 1000000;  // hours
  options.view_count = 2;
  options.view_size = 64;
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_cloud_refine_start(cut, cloud, &options, &job));
  // Cancelled among the steps, which come after a fifth of the whole.
  waitFor(job, 0.2);
  expectCancelled(job);
  StippleCloud* none = nullptr;
  EXPECT_EQ(stipple_job_cloud(job, &none), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(none, nullptr);
  stipple_job_free(job);
  EXPECT_EQ(valuesOf(cut), before);

  options.iterations = 2;
  STIPPLE_ASSERT_OK(stipple_cloud_refine_start(cut, cloud, &options, &job));
  STIPPLE_EXPECT_OK(stipple_job_wait(job));
  stipple_job_free(job);
  stipple_cloud_free(cut);
  stipple_model_free(model);
  stipple_cloud_free(cloud);
}

}  // namespace
}  // namespace stipple::test
