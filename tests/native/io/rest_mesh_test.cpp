#include "io/assets/rest_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "io/assets/motion_asset.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

RestMesh square() {
  RestMesh rest;
  rest.positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  rest.triangles = {0, 1, 2, 0, 2, 3};
  rest.topology = 0xfedcba9876543210u;
  rest.around = true;
  return rest;
}

class RestMeshes : public ScratchFolder {
 protected:
  /// An asset of one splat that moves.
  std::string asset() const {
    MotionAsset made;
    made.splats.resize(1);
    made.splats.rotations[0] = 1;
    made.splats.scales = {1, 1, 1};
    for (auto& wave : made.waves) wave.assign(3, 0.5f);
    made.phases.assign(4, 0);
    made.spins.assign(4, 0);
    made.lifespans.assign(2, 1);
    made.centres.assign(1, 0);
    made.settings_json = R"({"how":"by hand"})";
    const std::string path = (folder_ / "one.stipple.safetensors").string();
    writeMotionAsset(made, path);
    return path;
  }
};

TEST_F(RestMeshes, StandInAnAssetBesideWhatItHolds) {
  const std::string path = asset();
  EXPECT_FALSE(readRestMesh(path));
  const MotionAsset before = readMotionAsset(path);
  const std::string bound = (folder_ / "bound.stipple.safetensors").string();
  writeRestMesh(path, square(), bound);
  const auto read = readRestMesh(bound);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->positions, square().positions);
  EXPECT_EQ(read->triangles, square().triangles);
  EXPECT_EQ(read->topology, square().topology);
  EXPECT_TRUE(read->around);
  const MotionAsset after = readMotionAsset(bound);
  EXPECT_EQ(after.waves, before.waves);
  EXPECT_EQ(after.settings_json, before.settings_json);
  // Those who know nothing of it keep it.
  writeMotionAsset(after, path);
  ASSERT_TRUE(readRestMesh(path));
  EXPECT_EQ(readRestMesh(path)->triangles, square().triangles);
}

TEST_F(RestMeshes, TakeThePlaceOfEarlierOnesInTheSameFile) {
  const std::string path = asset();
  writeRestMesh(path, square(), path);
  RestMesh other = square();
  other.triangles.resize(3);
  other.around = false;
  writeRestMesh(path, other, path);
  EXPECT_EQ(readRestMesh(path)->triangles, other.triangles);
  EXPECT_FALSE(readRestMesh(path)->around);
}

TEST_F(RestMeshes, WithoutFacesOrWithWrongOnesAreRefused) {
  const std::string path = asset();
  RestMesh wrong = square();
  wrong.triangles.clear();
  expectError(ErrorCode::kInvalidArgument, {"0 triangles"},
              [&] { writeRestMesh(path, wrong, path); });
  wrong = square();
  wrong.triangles[4] = 4;
  expectError(ErrorCode::kInvalidArgument, {"name vertex 4", "it has 4"},
              [&] { writeRestMesh(path, wrong, path); });
  wrong = square();
  wrong.positions[5] = NAN;
  expectError(ErrorCode::kInvalidArgument, {"position of vertex 1"},
              [&] { writeRestMesh(path, wrong, path); });
  EXPECT_FALSE(readRestMesh(path)) << "nothing was written";
}

}  // namespace
}  // namespace stipple
