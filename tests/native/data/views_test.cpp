#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>

#include "base/error.h"
#include "data/views/memory_view_source.h"
#include "data/views/view_check.h"

namespace stipple {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

Camera cameraOf(uint32_t width, uint32_t height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  return camera;
}

ViewPicture pictureOf(uint32_t width, uint32_t height, float value) {
  ViewPicture picture;
  picture.width = width;
  picture.height = height;
  picture.colour.assign(size_t{width} * height * 3, value);
  return picture;
}

PointSet onePoint(float x, float y, float z) {
  PointSet points;
  points.positions = {x, y, z};
  points.colours = {1, 1, 1};
  points.opacities = {1};
  return points;
}

std::string messageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "no error";
}

TEST(MemoryViewSource, GivesBackWhatWasAdded) {
  MemoryViewSource views(ColourSpace::kLinear);
  // Whole 255ths come back bit for bit.
  ViewPicture picture = pictureOf(3, 2, 51.0f / 255.0f);
  picture.alpha.assign(6, 153.0f / 255.0f);
  views.add(cameraOf(3, 2), picture, "front");
  views.add(cameraOf(4, 4), pictureOf(4, 4, 1.0f));
  views.setPoints(onePoint(0, 0, 2));
  ASSERT_EQ(views.count(), 2u);
  EXPECT_EQ(views.name(0), "front");
  EXPECT_EQ(views.name(1), "view 1");
  EXPECT_EQ(views.camera(1).width, 4u);
  EXPECT_EQ(views.colourSpace(), ColourSpace::kLinear);
  EXPECT_EQ(views.load(0).alpha, picture.alpha);
  EXPECT_EQ(views.load(0).colour, picture.colour);
  EXPECT_EQ(views.points().size(), 1u);
  EXPECT_NE(messageOf([&] { views.load(2); }).find("view 2 was asked for"), std::string::npos);
}

TEST(MemoryViewSource, RefusesPicturesOfAnotherSizeThanTheirCamera) {
  MemoryViewSource views(ColourSpace::kDisplay);
  EXPECT_EQ(messageOf([&] { views.add(cameraOf(3, 2), pictureOf(2, 3, 0), "a.png"); }),
            "a.png: the image is 2 x 3 pixels, its camera's is 3 x 2 pixels");
  ViewPicture cut = pictureOf(3, 2, 0);
  cut.depth.resize(5);
  EXPECT_EQ(messageOf([&] { views.add(cameraOf(3, 2), cut, "a.png"); }),
            "a.png: depth holds 5 values; 6 are needed");
  EXPECT_EQ(views.count(), 0u);
}

TEST(MemoryViewSource, NamesThePixelThatIsNotANumber) {
  MemoryViewSource views(ColourSpace::kDisplay);
  // Larger than what one thread looks at, bad in its last part.
  ViewPicture picture = pictureOf(700, 500, 0.25f);
  picture.colour[(size_t{499} * 700 + 698) * 3 + 1] = kNaN;
  picture.colour.back() = kNaN;
  EXPECT_EQ(messageOf([&] { views.add(cameraOf(700, 500), picture, "b.exr"); }),
            "b.exr: pixel (698, 499) has colour nan; a finite number is needed");
  picture = pictureOf(4, 1, 0);
  picture.alpha = {0, 1, 1.5f, 1};
  EXPECT_NE(messageOf([&] { views.add(cameraOf(4, 1), picture, "c"); }).find("pixel (2, 0)"),
            std::string::npos);
  picture.alpha.clear();
  picture.weights = {0, -1, 0, 0};
  EXPECT_NE(messageOf([&] { views.add(cameraOf(4, 1), picture, "c"); }).find("pixel (1, 0)"),
            std::string::npos);
}

TEST(MemoryViewSource, RefusesBadCamerasAndPoints) {
  MemoryViewSource views(ColourSpace::kDisplay);
  Camera camera = cameraOf(2, 2);
  camera.fx = 0;
  EXPECT_NE(messageOf([&] { views.add(camera, pictureOf(2, 2, 0), "d"); }).find("d: "),
            std::string::npos);
  PointSet points = onePoint(0, kNaN, 1);
  EXPECT_NE(messageOf([&] { views.setPoints(points); }).find("positions of point 0"),
            std::string::npos);
  points = onePoint(0, 0, 1);
  points.normals = {0, 0};
  EXPECT_NE(messageOf([&] { views.setPoints(points); }).find("normals holds 2 values"),
            std::string::npos);
}

TEST(MemoryViewSource, KnowsWhenAPictureWasTaken) {
  MemoryViewSource views(ColourSpace::kDisplay);
  views.add(cameraOf(3, 2), pictureOf(3, 2, 0.5f));
  views.add(cameraOf(3, 2), pictureOf(3, 2, 0.5f), "later", 2.5);
  EXPECT_EQ(views.time(0), 0);
  EXPECT_EQ(views.time(1), 2.5);
  for (const double time : {std::nan(""), HUGE_VAL}) {
    EXPECT_NE(messageOf([&] {
                views.add(cameraOf(3, 2), pictureOf(3, 2, 0.5f), "never", time);
              }).find("never: time"),
              std::string::npos);
  }
  EXPECT_EQ(views.count(), 2u);
}

TEST(ViewCheck, RefusesATimeThatIsNotFinite) {
  class Timeless final : public ViewSource {
   public:
    explicit Timeless(const MemoryViewSource& views) : views_(views) {}
    size_t count() const override { return views_.count(); }
    const Camera& camera(size_t view) const override { return views_.camera(view); }
    std::string name(size_t view) const override { return views_.name(view); }
    ColourSpace colourSpace() const override { return views_.colourSpace(); }
    double time(size_t) const override { return std::nan(""); }
    ViewPicture load(size_t view) const override { return views_.load(view); }
    const PointSet& points() const override { return views_.points(); }

   private:
    const MemoryViewSource& views_;
  };
  MemoryViewSource views(ColourSpace::kDisplay);
  views.add(cameraOf(3, 2), pictureOf(3, 2, 0.5f), "front");
  EXPECT_NE(messageOf([&] { checkViews(Timeless(views), {}, nullptr); }).find("front: time"),
            std::string::npos);
}

TEST(ViewCheck, RefusesNoViewsAndViewsThatShowNothing) {
  MemoryViewSource views(ColourSpace::kDisplay);
  EXPECT_EQ(messageOf([&] { checkViews(views); }), "there are no views; at least one is needed");
  views.add(cameraOf(2, 2), pictureOf(2, 2, 0), "e");
  ViewPicture clear = pictureOf(2, 2, 0);
  clear.alpha.assign(4, 0.0f);
  EXPECT_EQ(messageOf([&] { checkViews(views); }),
            "all 1 images that were looked at are black everywhere (e is the first); at least "
            "one must show something");
  views.add(cameraOf(2, 2), clear, "f");
  EXPECT_NE(messageOf([&] { checkViews(views); }).find("black, transparent or masked out"),
            std::string::npos);
}

TEST(ViewCheck, WarnsOfPicturesThatShowNothing) {
  MemoryViewSource views(ColourSpace::kDisplay);
  for (int i = 0; i < 5; ++i) {
    views.add(cameraOf(2, 2), pictureOf(2, 2, 0), "dark" + std::to_string(i));
  }
  ViewPicture picture = pictureOf(2, 2, 1);
  picture.alpha.assign(4, 0.0f);
  views.add(cameraOf(2, 2), picture, "clear");
  picture.alpha.clear();
  picture.weights.assign(4, 0.0f);
  views.add(cameraOf(2, 2), picture, "masked");
  views.add(cameraOf(2, 2), pictureOf(2, 2, 1), "good");
  const std::vector<std::string> warnings = checkViews(views);
  ASSERT_EQ(warnings.size(), 3u);
  EXPECT_EQ(warnings[0], "5 images are black everywhere: dark0, dark1, dark2 and 2 more");
  EXPECT_EQ(warnings[1], "1 image is transparent everywhere: clear");
  EXPECT_EQ(warnings[2], "1 image is masked out everywhere: masked");
}

TEST(ViewCheck, SaysThatOneViewIsFew) {
  MemoryViewSource views(ColourSpace::kDisplay);
  views.add(cameraOf(2, 2), pictureOf(2, 2, 1), "only");
  const std::vector<std::string> warnings = checkViews(views);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("there is one view (only)"), std::string::npos);
}

TEST(ViewCheck, FindsCamerasThatSeeNoPoint) {
  MemoryViewSource views(ColourSpace::kDisplay);
  Camera away = cameraOf(2, 2);
  away.world_to_camera.topLeftCorner<3, 3>() =
      Eigen::AngleAxisd(M_PI, Vec3d::UnitY()).toRotationMatrix();
  views.add(away, pictureOf(2, 2, 1), "away");
  views.setPoints(onePoint(0, 0, 2));
  EXPECT_NE(messageOf([&] { checkViews(views); }).find("none of the 1 cameras sees any"),
            std::string::npos);
  views.add(cameraOf(2, 2), pictureOf(2, 2, 1), "towards");
  const std::vector<std::string> warnings = checkViews(views);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], "1 camera sees none of the scene's points: away");
}

TEST(ViewCheck, LooksAtAFewPicturesOfMany) {
  class Counting final : public ViewSource {
   public:
    size_t count() const override { return 10000; }
    const Camera& camera(size_t) const override { return camera_; }
    std::string name(size_t view) const override { return std::to_string(view); }
    ColourSpace colourSpace() const override { return ColourSpace::kDisplay; }
    ViewPicture load(size_t) const override {
      ++loads_;
      return pictureOf(2, 2, 1);
    }
    const PointSet& points() const override { return points_; }
    mutable size_t loads_ = 0;

   private:
    Camera camera_ = cameraOf(2, 2);
    PointSet points_;
  };
  const Counting views;
  EXPECT_TRUE(checkViews(views, {.picture_count = 7}).empty());
  EXPECT_EQ(views.loads_, 7u);
}

}  // namespace
}  // namespace stipple
