#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <thread>

#include "api/fixtures.h"

namespace stipple::test {
namespace {

using Boundary = ApiTest;

TEST(Version, AgreesWithTheHeader) {
  EXPECT_EQ(stipple_abi_version(), STIPPLE_ABI_VERSION);
  EXPECT_STRNE(stipple_version_string(), "");
}

TEST_F(Boundary, RefusesNullArgumentsByName) {
  StippleCloud* cloud = reinterpret_cast<StippleCloud*>(1);
  EXPECT_EQ(stipple_cloud_create(nullptr, nullptr, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(stipple_last_error_message()).find("context is NULL"), std::string::npos);
  EXPECT_EQ(cloud, reinterpret_cast<StippleCloud*>(1)) << "outputs stay untouched on an error";
  EXPECT_EQ(stipple_cloud_create(context_, nullptr, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(stipple_last_error_message()).find("arrays is NULL"), std::string::npos);
  EXPECT_EQ(stipple_job_wait(nullptr), STIPPLE_ERROR_INVALID_ARGUMENT);
}

TEST_F(Boundary, KeepsMessagesApartByThread) {
  EXPECT_NE(stipple_cloud_info(nullptr, nullptr), STIPPLE_OK);
  std::string other;
  std::thread([&] { other = stipple_last_error_message(); }).join();
  EXPECT_EQ(other, "");
  EXPECT_STRNE(stipple_last_error_message(), "");
}

TEST_F(Boundary, FillsAnOlderCallersShorterStructOnlyAsFarAsItGoes) {
  StippleCloud* cloud = oneSplat(1, 1, 1);
  struct {
    StippleCloudInfo info;
    uint64_t guard;
  } memory;
  std::memset(&memory, 0xab, sizeof(memory));
  memory.info.struct_size = 24;  // up to and including count
  STIPPLE_EXPECT_OK(stipple_cloud_info(cloud, &memory.info));
  EXPECT_EQ(memory.info.count, 1u);
  unsigned char after[sizeof(memory) - 24];
  std::memcpy(after, reinterpret_cast<unsigned char*>(&memory) + 24, sizeof(after));
  for (const unsigned char byte : after) EXPECT_EQ(byte, 0xab);
  stipple_cloud_free(cloud);
}

TEST_F(Boundary, RefusesAStructWithoutItsSize) {
  StippleCloud* cloud = oneSplat(1, 1, 1);
  StippleCloudInfo info = {};
  EXPECT_EQ(stipple_cloud_info(cloud, &info), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(stipple_last_error_message()).find("struct_size is 0"), std::string::npos);
  stipple_cloud_free(cloud);
}

TEST_F(Boundary, RefusesSplatsThatAreNotNumbers) {
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(),
                       std::numeric_limits<float>::infinity()};
  for (const float value : bad) {
    const float position[3] = {0, value, 0}, rotation[4] = {1, 0, 0, 0}, scale[3] = {1, 1, 1};
    const float opacity = 0.5f, sh[3] = {0, 0, 0};
    auto arrays = sized<StippleCloudArrays>();
    arrays.count = 1;
    arrays.positions = position;
    arrays.rotations = rotation;
    arrays.scales = scale;
    arrays.opacities = &opacity;
    arrays.sh = sh;
    StippleCloud* cloud = nullptr;
    EXPECT_EQ(stipple_cloud_create(context_, &arrays, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(cloud, nullptr);
  }
}

TEST_F(Boundary, GivesBackTheSplatsItWasGiven) {
  StippleCloud* cloud = oneSplat(0.25f, 0.5f, 0.75f, 0.625f);
  float position[3], rotation[4], scale[3], opacity, sh[3];
  auto buffers = sized<StippleCloudBuffers>();
  buffers.capacity = 1;
  buffers.positions = position;
  buffers.rotations = rotation;
  buffers.scales = scale;
  buffers.opacities = &opacity;
  buffers.sh = sh;
  STIPPLE_EXPECT_OK(stipple_cloud_read(cloud, &buffers));
  EXPECT_EQ(opacity, 0.625f);
  EXPECT_EQ(scale[2], 0.3f);
  EXPECT_EQ(sh[1], 0.0f);
  buffers.capacity = 0;
  EXPECT_EQ(stipple_cloud_read(cloud, &buffers), STIPPLE_ERROR_BUFFER_TOO_SMALL);
  stipple_cloud_free(cloud);
}

TEST_F(Boundary, RefusesBudgetsOutsideTheRange) {
  StippleModel* model = cubeModel(context_);
  for (const uint64_t budget : {uint64_t{0}, uint64_t{STIPPLE_MAX_ANCHORS} + 1, UINT64_MAX}) {
    StippleDecodeOptions options;
    stipple_decode_options_init(&options);
    options.anchor_count = budget;
    StippleCloud* cloud = nullptr;
    EXPECT_EQ(stipple_model_decode(model, &options, &cloud), STIPPLE_ERROR_INVALID_ARGUMENT);
    const std::string message = stipple_last_error_message();
    EXPECT_NE(message.find(std::to_string(budget)), std::string::npos) << message;
    EXPECT_NE(message.find("268435456"), std::string::npos) << message;
    EXPECT_EQ(cloud, nullptr);
  }
  stipple_model_free(model);
}

TEST_F(Boundary, RefusesABudgetAboveTheMemoryLimitBeforeItAllocates) {
  StippleContextOptions limited;
  stipple_context_options_init(&limited);
  limited.memory_limit_bytes = 64 << 20;
  StippleContext* context = nullptr;
  STIPPLE_ASSERT_OK(stipple_context_create(&limited, &context));
  StippleModel* model = cubeModel(context);
  StippleDecodeOptions options;
  stipple_decode_options_init(&options);
  options.anchor_count = STIPPLE_MAX_ANCHORS;
  StippleCloud* cloud = nullptr;
  EXPECT_EQ(stipple_model_decode(model, &options, &cloud), STIPPLE_ERROR_MEMORY_LIMIT);
  const std::string message = stipple_last_error_message();
  const std::string mark = "the memory limit is 64.00 MiB, and at most ";
  ASSERT_NE(message.find(mark), std::string::npos) << message;
  options.anchor_count = std::stoull(message.substr(message.find(mark) + mark.size()));
  STIPPLE_EXPECT_OK(stipple_model_decode(model, &options, &cloud));
  stipple_cloud_free(cloud);
  ++options.anchor_count;
  EXPECT_EQ(stipple_model_decode(model, &options, &cloud), STIPPLE_ERROR_MEMORY_LIMIT)
      << "more would have fitted than it said";
  options.anchor_count = STIPPLE_MAX_ANCHORS;
  uint64_t bound = 0;
  STIPPLE_EXPECT_OK(stipple_model_decode_memory_bound(model, &options, &bound));
  EXPECT_GT(bound, uint64_t{STIPPLE_MAX_ANCHORS} * 56) << "less than the splats themselves";
  options.anchor_count = 1000;
  STIPPLE_EXPECT_OK(stipple_model_decode(model, &options, &cloud));
  stipple_cloud_free(cloud);
  stipple_model_free(model);
  stipple_context_free(context);
}

TEST_F(Boundary, RefusesMeshesWithoutFacesOrWithBadVertices) {
  StippleMesh* mesh = nullptr;
  STIPPLE_ASSERT_OK(stipple_mesh_create(context_, &mesh));
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_model_from_mesh_start(context_, mesh, nullptr, &job));
  EXPECT_EQ(stipple_job_wait(job), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_STRNE(stipple_last_error_message(), "");
  stipple_job_free(job);

  CubeArrays bad;
  bad.positions[4] = std::numeric_limits<float>::quiet_NaN();
  StippleMeshPart part = bad.part();
  EXPECT_EQ(stipple_mesh_add_part(mesh, &part), STIPPLE_ERROR_INVALID_ARGUMENT);
  CubeArrays outside;
  outside.triangles[5] = 8;
  part = outside.part();
  EXPECT_EQ(stipple_mesh_add_part(mesh, &part), STIPPLE_ERROR_INVALID_ARGUMENT);
  auto info = sized<StippleMeshInfo>();
  STIPPLE_EXPECT_OK(stipple_mesh_info(mesh, &info));
  EXPECT_EQ(info.triangle_count, 0u) << "a refused part changes nothing";
  stipple_mesh_free(mesh);
}

TEST_F(Boundary, NamesTheUvMapThatATexturedPartLacks) {
  StippleMesh* mesh = nullptr;
  STIPPLE_ASSERT_OK(stipple_mesh_create(context_, &mesh));
  const float pixel[3] = {1, 0, 0};
  uint32_t texture = 0, material = 0;
  STIPPLE_ASSERT_OK(stipple_mesh_add_texture(mesh, 1, 1, 3, pixel, 1, &texture));
  auto textured = sized<StippleMaterial>();
  textured.colour = STIPPLE_MATERIAL_TEXTURE;
  textured.texture = texture;
  STIPPLE_ASSERT_OK(stipple_mesh_add_material(mesh, &textured, &material));
  const std::vector<uint32_t> materials(12, material);
  StippleMeshPart part = cube_.part();
  part.triangle_materials = materials.data();
  EXPECT_EQ(stipple_mesh_add_part(mesh, &part), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(stipple_last_error_message()).find("UV"), std::string::npos);
  textured.texture = texture + 1;
  EXPECT_EQ(stipple_mesh_add_material(mesh, &textured, &material), STIPPLE_ERROR_INVALID_ARGUMENT);
  stipple_mesh_free(mesh);
}

TEST_F(Boundary, SaysWhichFileIsMissing) {
  StippleCloud* cloud = nullptr;
  EXPECT_EQ(stipple_cloud_load(context_, "/no/such/folder/a.ply", &cloud), STIPPLE_ERROR_IO);
  EXPECT_NE(std::string(stipple_last_error_message()).find("/no/such/folder/a.ply"),
            std::string::npos);
}

}  // namespace
}  // namespace stipple::test
