#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/backward_cases.h"
#include "splat/cpu/tiles/tiled_render.h"

// Going backward from the picture that was drawn, as a step of training does.

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::frontCamera;
using testing::pixelCount;
using testing::randomCloud;
using testing::randomWeights;
using testing::smallCloud;

struct Drawn {
  Camera camera = frontCamera(150, 110, 110, 3);
  RenderWorkspace workspace;
  RenderResult picture;
  BackwardWorkspace backward;
  BackwardResult result;
  std::vector<float> gradient = randomWeights(pixelCount(camera) * 4, 1);
  std::vector<float> depth_gradient = randomWeights(pixelCount(camera), 2);

  Drawn() { workspace.keepForBackward(true); }

  void draw(std::span<const SplatInstance> instances, const RenderOptions& options = {}) {
    renderTiled(instances, camera, options, workspace, picture);
  }
  BackwardInput input() const {
    BackwardInput made;
    made.colour_gradient = gradient;
    return made;
  }
  void goBack(const BackwardInput& input) {
    renderBackward(workspace, picture, input, backward, result);
  }
  std::string refusal(const BackwardInput& input) {
    try {
      goBack(input);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
      return error.what();
    }
    return "accepted";
  }
};

void expectSame(const BackwardResult& a, const BackwardResult& b) {
  ASSERT_EQ(a.instances.size(), b.instances.size());
  for (size_t i = 0; i < a.instances.size(); ++i) {
    EXPECT_EQ(a.instances[i].positions, b.instances[i].positions);
    EXPECT_EQ(a.instances[i].rotations, b.instances[i].rotations);
    EXPECT_EQ(a.instances[i].scales, b.instances[i].scales);
    EXPECT_EQ(a.instances[i].opacities, b.instances[i].opacities);
    EXPECT_EQ(a.instances[i].sh, b.instances[i].sh);
    EXPECT_EQ(a.instances[i].contributions, b.instances[i].contributions);
  }
  EXPECT_EQ(a.camera, b.camera);
  EXPECT_EQ(a.background, b.background);
  EXPECT_EQ(a.visible_count, b.visible_count);
}

TEST(BackwardFromDrawing, GivesTheBitsOfTheCallFromNothing) {
  CloudRecipe recipe;
  recipe.count = 6000;
  recipe.degree = 1;
  const SplatCloud cloud = randomCloud(recipe, 3);
  const SplatCloud other = smallCloud(50, 2, 4);
  const SplatCloud empty;
  const SplatInstance instances[] = {{&cloud}, {&empty}, {&other}};
  RenderOptions options;
  options.with_background = true;
  options.background[1] = 0.5;
  Drawn drawn;
  drawn.draw(instances, options);
  BackwardInput input = drawn.input();
  input.depth_gradient = drawn.depth_gradient;
  const std::vector<float> residual = randomWeights(pixelCount(drawn.camera) * 3, 5);
  for (const bool with_contributions : {false, true}) {
    if (with_contributions) input.residual = residual;
    for (const unsigned threads : {1u, 2u}) {
      // Twice from one picture: nothing of it is used up.
      withThreads(threads, [&] { drawn.goBack(input); });
      expectSame(drawn.result, renderBackward(instances, drawn.camera, options, input));
    }
  }
}

TEST(BackwardFromDrawing, RefusesAnotherPictureThanTheLast) {
  const SplatCloud cloud = smallCloud(30, 1, 6);
  const SplatInstance instance{&cloud};
  Drawn drawn;
  EXPECT_NE(drawn.refusal(drawn.input()).find("keepForBackward"), std::string::npos);
  drawn.draw({&instance, 1});
  EXPECT_EQ(drawn.refusal(drawn.input()), "accepted");
  const RenderResult first = drawn.picture;
  drawn.draw({&instance, 1});
  EXPECT_EQ(drawn.refusal(drawn.input()), "accepted");
  drawn.picture = first;
  EXPECT_NE(drawn.refusal(drawn.input()).find("is not what the workspace drew last"),
            std::string::npos);
  // A drawing that fails on the way leaves nothing to go back from.
  drawn.draw({&instance, 1});
  SplatCloud broken = cloud;
  broken.scales[2] = -1.0f;
  const SplatInstance bad{&broken};
  EXPECT_THROW(drawn.draw({&bad, 1}), Error);
  EXPECT_NE(drawn.refusal(drawn.input()).find("keeps no image"), std::string::npos);
  // Nor does one that does not keep.
  drawn.workspace.keepForBackward(false);
  drawn.draw({&instance, 1});
  EXPECT_NE(drawn.refusal(drawn.input()).find("keeps no image"), std::string::npos);
}

TEST(BackwardFromDrawing, RefusesSplatsThatChangedAndLeavesTheResultAlone) {
  const SplatCloud cloud = smallCloud(200, 1, 7);
  for (std::vector<float> SplatCloud::*array :
       {&SplatCloud::positions, &SplatCloud::rotations, &SplatCloud::scales, &SplatCloud::opacities,
        &SplatCloud::sh}) {
    SplatCloud stepped = cloud;
    const SplatInstance instance{&stepped};
    Drawn drawn;
    drawn.draw({&instance, 1});
    drawn.goBack(drawn.input());
    const BackwardResult before = drawn.result;
    for (float& value : stepped.*array) value *= 0.99f;  // as a step of training does
    EXPECT_NE(drawn.refusal(drawn.input()).find("the splats changed"), std::string::npos);
    expectSame(drawn.result, before);
    stepped.resize(100);
    EXPECT_NE(drawn.refusal(drawn.input()).find("the splats changed"), std::string::npos);
  }
}

TEST(BackwardFromDrawing, NoticesOneBitOfOnePositionOrOpacity) {
  SplatCloud cloud = smallCloud(9000, 0, 9);  // more than are looked at together
  const SplatInstance instance{&cloud};
  Drawn drawn;
  drawn.draw({&instance, 1});
  for (std::vector<float>* array : {&cloud.positions, &cloud.opacities}) {
    for (const size_t at : {size_t{0}, array->size() / 2 + 1, array->size() - 1}) {
      const float before = (*array)[at];
      (*array)[at] = std::nextafter(before, 2.0f);
      EXPECT_NE(drawn.refusal(drawn.input()).find("the splats changed"), std::string::npos);
      (*array)[at] = before;
    }
  }
  drawn.goBack(drawn.input());
}

TEST(BackwardFromDrawing, RefusesADepthGradientWithoutDepthAndTooLittleMemory) {
  const SplatCloud cloud = smallCloud(30, 1, 8);
  const SplatInstance instance{&cloud};
  Drawn drawn;
  RenderOptions options;
  options.with_depth = false;
  drawn.draw({&instance, 1}, options);
  BackwardInput input = drawn.input();
  input.depth_gradient = drawn.depth_gradient;
  EXPECT_NE(drawn.refusal(input).find("without depth"), std::string::npos);
  const uint64_t bound = backwardMemoryBound(drawn.workspace, drawn.input());
  EXPECT_LT(bound, backwardMemoryBound({&instance, 1}, drawn.camera, options, drawn.input()));
  try {
    renderBackward(drawn.workspace, drawn.picture, drawn.input(), drawn.backward, drawn.result,
                   bound - 1);
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kMemoryLimit);
    EXPECT_NE(std::string(error.what()).find(std::to_string(bound)), std::string::npos);
  }
}

/// A picture and its strips: derivatives of all pixels are the sums of those of the strips. An
/// orthographic camera, whose projection does not depend on the size of the picture.
void expectSumOfStrips(const SplatCloud& cloud, uint32_t side, uint32_t strips) {
  Camera camera = frontCamera(side, side, side / 3.0, 3);
  camera.model = CameraModel::kOrthographic;
  camera.fx = camera.fy = side / 3.0;
  const SplatInstance instance{&cloud};
  const std::vector<float> gradient = randomWeights(pixelCount(camera) * 4, 10);
  BackwardInput input;
  input.colour_gradient = gradient;
  input.with_blending_weights = true;
  const SplatGradients all = renderBackward({&instance, 1}, camera, {}, input).instances[0];
  std::vector<double> weights(cloud.size(), 0.0);
  std::vector<double> opacities(cloud.size(), 0.0);
  const uint32_t rows = side / strips;
  ASSERT_EQ(rows % 16, 0u);  // whole tiles, so that float32 sums are the same
  for (uint32_t strip = 0; strip < strips; ++strip) {
    Camera part = camera;
    part.height = rows;
    part.cy = camera.cy - strip * rows;
    const size_t values = pixelCount(part) * 4;
    input.colour_gradient = std::span(gradient).subspan(strip * values, values);
    const SplatGradients of = renderBackward({&instance, 1}, part, {}, input).instances[0];
    for (size_t i = 0; i < cloud.size(); ++i) {
      weights[i] += static_cast<double>(of.blending_weights[i]);
      opacities[i] += static_cast<double>(of.opacities[i]);
    }
  }
  double most = 0;
  for (size_t i = 0; i < cloud.size(); ++i) most = std::max(most, std::abs(opacities[i]));
  EXPECT_GT(most, 0);
  for (size_t i = 0; i < cloud.size(); ++i) {
    // Sums are stored in float32 after each part of the tiles: 6e-8 of the largest, a few times.
    EXPECT_NEAR(static_cast<double>(all.blending_weights[i]), weights[i], 1e-6 * weights[i]);
    EXPECT_NEAR(static_cast<double>(all.opacities[i]), opacities[i], 1e-6 * most);
  }
}

SplatCloud coveringCloud(size_t count, float opacity) {
  SplatCloud cloud = smallCloud(count, 0, 11);
  for (float& scale : cloud.scales) scale = 5.0f;
  for (float& o : cloud.opacities) o = opacity;
  return cloud;
}

TEST(BackwardFromDrawing, AddsUpTilesThatAreHeldInSeveralParts) {
  // 900 tiles list 1,200 splats each: more than the million entries that are held at once.
  expectSumOfStrips(coveringCloud(1200, 0.02f), 480, 2);
}

TEST(BackwardFromDrawing, ListsSplatsAgainWhereTheDrawingCouldNotKeepTheLists) {
  const SplatCloud cloud = smallCloud(300, 1, 12);
  const SplatInstance instance{&cloud};
  Drawn drawn;
  drawn.draw({&instance, 1});
  drawn.goBack(drawn.input());
  const BackwardResult before = drawn.result;
  // As after a drawing whose lists came in several groups, of which only the last is there.
  drawn.workspace.arrays().lists.group.first_tile = 3;
  drawn.goBack(drawn.input());
  expectSame(drawn.result, before);
}

TEST(BackwardFromDrawing, IsCountedInTheMemoryOfTheDrawing) {
  const SplatCloud cloud = smallCloud(300, 1, 12);
  const SplatInstance instance{&cloud};
  Drawn drawn;
  drawn.camera = frontCamera(1500, 1100, 1100, 3);
  drawn.draw({&instance, 1});
  const RenderMemory plain = renderMemory({&instance, 1}, drawn.camera, {});
  const RenderMemory kept = renderMemory({&instance, 1}, drawn.camera, {}, true);
  EXPECT_LE(drawn.workspace.bytes(), kept.sum() - kept.result_bytes);
  // Transmittance and end of each pixel, and its coverage for the depth, over whole tiles.
  EXPECT_GE(kept.pixel_bytes - plain.pixel_bytes, 12u * 1504u * 1104u);
  EXPECT_LE(kept.pixel_bytes, 64u * pixelCount(drawn.camera));
}

TEST(BackwardFromDrawing, IgnoresDepthWhereNothingCoversThePixel) {
  const SplatCloud cloud = smallCloud(1, 0, 9);
  SplatCloud away = cloud;
  for (size_t i = 0; i < 3; ++i) away.positions[i] = 1000.0f;
  const SplatInstance instance{&away};
  Drawn drawn;
  drawn.draw({&instance, 1});
  BackwardInput input = drawn.input();
  input.depth_gradient = drawn.depth_gradient;
  drawn.goBack(input);
  for (const float value : drawn.result.instances[0].positions) EXPECT_EQ(value, 0.0f);
}

}  // namespace
}  // namespace stipple
