// Does a process that works on and on keep what it has worked with?
#include <gtest/gtest.h>
#include <malloc.h>
#include <stdlib.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "fixtures.h"

namespace stipple::test {
namespace {

/// Resident memory of this process, without what malloc only keeps for later.
double residentKib() {
  malloc_trim(0);
  double pages = 0;
  std::ifstream("/proc/self/statm") >> pages >> pages;
  return pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1024;
}

class MemoryTest : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    // In memory where possible: a disk would be asked a thousand times to keep a file for good.
    const std::filesystem::path memory = "/dev/shm";
    const std::filesystem::path base =
        ::access(memory.c_str(), W_OK) == 0 ? memory : std::filesystem::temp_directory_path();
    std::string pattern = (base / "stipple_memory_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    StippleCloud* cloud = oneSplat(1, 0.5f, 0);
    STIPPLE_ASSERT_OK(stipple_cloud_save(cloud, ply().c_str(), nullptr));
    stipple_cloud_free(cloud);
    model_ = cubeModel(context_);
  }
  void TearDown() override {
    stipple_model_free(model_);
    std::filesystem::remove_all(folder_);
    ApiTest::TearDown();
  }
  std::string ply() const { return (folder_ / "a.ply").string(); }

  /// Loads, draws and saves a cloud, and decodes a model.
  void workOnce() {
    StippleCloud* cloud = nullptr;
    STIPPLE_ASSERT_OK(stipple_cloud_load(context_, ply().c_str(), &cloud));
    StippleRenderOptions options;
    stipple_render_options_init(&options);
    StippleCamera camera = frontCamera();
    camera.width = camera.height = 32;
    EXPECT_EQ(render(context_, cloud, options, camera).size(), 32u * 32 * 4);
    STIPPLE_ASSERT_OK(stipple_cloud_save(cloud, ply().c_str(), nullptr));
    stipple_cloud_free(cloud);
    StippleDecodeOptions decode;
    stipple_decode_options_init(&decode);
    decode.anchor_count = 100;
    STIPPLE_ASSERT_OK(stipple_model_decode(model_, &decode, &cloud));
    stipple_cloud_free(cloud);
  }

  std::filesystem::path folder_;
  StippleModel* model_ = nullptr;
};

// STIPPLE_MEMORY_CALLS=10000 asks longer.
TEST_F(MemoryTest, StaysFlatOverManyCalls) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "Sanitizers keep what is freed, so that resident memory says nothing.";
#endif
  const char* const asked = ::getenv("STIPPLE_MEMORY_CALLS");
  const int calls = asked ? std::atoi(asked) : 300;
  // Until every thread has its own buffers, and malloc its arenas.
  for (int i = 0; i < 50; ++i) workOnce();
  const double before = residentKib();
  for (int i = 0; i < calls; ++i) workOnce();
  const double grown = residentKib() - before;
  // Arenas of threads for each call keep 11 KiB of a round, 3.3 MiB of 300. What threads and
  // malloc come to keep does not grow with the number of rounds, and is about 0.1 MiB.
  EXPECT_LT(grown, 1024) << "KiB of " << calls << " rounds";
}

}  // namespace
}  // namespace stipple::test
