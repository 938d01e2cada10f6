#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>

#include "io/views/camera_file.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

/// A COLMAP model put together byte by byte.
struct Bytes {
  std::string text;
  template <typename T>
  Bytes& add(T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    text.append(bytes, sizeof(T));
    return *this;
  }
};

class Colmap : public ScratchFolder {
 protected:
  void makeFolder(const std::string& name) const {
    std::filesystem::create_directories(folder_ / name);
  }

  /// Two pinhole cameras, two pictures; the second camera turns by 90 degrees about x.
  static std::string cameras() {
    Bytes bytes;
    bytes.add<uint64_t>(2);
    bytes.add<uint32_t>(7).add<int32_t>(0).add<uint64_t>(640).add<uint64_t>(480);
    bytes.add(500.0).add(320.25).add(240.5);
    bytes.add<uint32_t>(3).add<int32_t>(1).add<uint64_t>(100).add<uint64_t>(50);
    bytes.add(80.0).add(90.0).add(51.0).add(24.0);
    return bytes.text;
  }
  static std::string images() {
    Bytes bytes;
    bytes.add<uint64_t>(2);
    bytes.add<uint32_t>(11);
    for (const double value : {1.0, 1.0, 0.0, 0.0, 1.0, 2.0, 3.0}) bytes.add(value);
    bytes.add<uint32_t>(3);
    bytes.text += std::string("second view.png") + '\0';
    bytes.add<uint64_t>(2);
    for (int point = 0; point < 2; ++point) bytes.add(1.5).add(2.5).add<int64_t>(-1);
    bytes.add<uint32_t>(12);
    for (const double value : {1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0}) bytes.add(value);
    bytes.add<uint32_t>(7);
    bytes.text += std::string("first.png") + '\0';
    bytes.add<uint64_t>(0);
    return bytes.text;
  }
  static constexpr char kTextCameras[] =
      "# Camera list\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
      "7 SIMPLE_PINHOLE 640 480 500 320.25 240.5\n3 PINHOLE 100 50 80 90 51 24\r\n";
  static constexpr char kTextImages[] =
      "# Image list with two lines of data per image:\n"
      "11 1 1 0 0 1 2 3 3 second view.png\n1.5 2.5 -1 1.5 2.5 -1\n"
      "12 1 0 0 0 0 0 4 7 first.png\n\n";

  void storeBinary(const std::string& folder = ".") const {
    makeFolder(folder);
    store(folder + "/cameras.bin", cameras());
    store(folder + "/images.bin", images());
  }
  void storeText(const std::string& cameras = kTextCameras,
                 const std::string& images = kTextImages) const {
    store("cameras.txt", cameras);
    store("images.txt", images);
  }
  std::string folder() const { return folder_.string(); }

  static void expectBoth(const std::vector<CameraView>& views) {
    ASSERT_EQ(views.size(), 2u);
    EXPECT_EQ(views[0].image_path, "first.png");
    EXPECT_EQ(views[1].image_path, "second view.png");
    const Camera& first = views[0].camera;
    validate(first);
    EXPECT_EQ(first.width, 640u);
    EXPECT_EQ(first.height, 480u);
    EXPECT_EQ(first.fx, 500);
    EXPECT_EQ(first.fy, 500);
    EXPECT_EQ(first.cx, 320.25);
    EXPECT_EQ(first.cy, 240.5);
    EXPECT_EQ(cameraCentre(first), Vec3d(0, 0, -4));
    const Camera& second = views[1].camera;
    validate(second);
    EXPECT_EQ(second.fx, 80);
    EXPECT_EQ(second.fy, 90);
    EXPECT_EQ(second.cx, 51);
    EXPECT_EQ(second.cy, 24);
    // A quarter turn about x takes y to z: R = [1 0 0; 0 0 -1; 0 1 0], centre = -R^T (1, 2, 3).
    // 1e-15: one rounding of numbers below 4.
    EXPECT_TRUE(cameraCentre(second).isApprox(Vec3d(-1, -3, 2), 1e-15));
    const Vec4d seen = second.world_to_camera * Vec4d(10, 20, 30, 1);
    EXPECT_TRUE(seen.head<3>().isApprox(Vec3d(11, -28, 23), 1e-15));
  }
};

TEST_F(Colmap, ReadsBinaryAndTextAlike) {
  storeText();
  expectBoth(readCameraFile(folder()));
  std::filesystem::remove(path("cameras.txt"));
  std::filesystem::remove(path("images.txt"));
  storeBinary();
  expectBoth(readCameraFile(folder()));
}

TEST_F(Colmap, ReadsLinesThatAreLongerThanItsBuffer) {
  // Three million bytes of points of the first picture, and no line end after the last.
  std::string points;
  while (points.size() < 3000000) points += "1.5 2.5 -1 ";
  storeText(kTextCameras,
            "11 1 1 0 0 1 2 3 3 second view.png\n" + points + "\n12 1 0 0 0 0 0 4 7 first.png");
  expectBoth(readCameraFile(folder()));
  storeText(kTextCameras,
            "11 1 1 0 0 1 2 3 3 second view.png\n" + points + "\n12 1 0 0 0 0 0 4 x first.png");
  expectError(ErrorCode::kFormat, {"images.txt: line 3", "'x'"}, [&] { readCameraFile(folder()); });
}

TEST_F(Colmap, FindsTheModelInTheUsualPlaces) {
  storeBinary("scene/sparse/0");
  for (const char* name : {"scene", "scene/sparse/0", "scene/sparse/0/images.bin"}) {
    SCOPED_TRACE(name);
    expectBoth(readCameraFile(path(name)));
  }
  storeBinary("other/sparse");
  expectBoth(readCameraFile(path("other")));
  makeFolder("empty");
  expectError(ErrorCode::kFormat, {"empty", "holds no cameras", "sparse/0"},
              [&] { readCameraFile(path("empty")); });
}

TEST_F(Colmap, TransformsOfAFolderWin) {
  storeBinary("sparse/0");
  store("transforms.json",
        "{\"fl_x\": 500, \"w\": 640, \"h\": 480, \"frames\": [{\"transform_matrix\": "
        "[[1,0,0,1],[0,0,-1,2],[0,1,0,3],[0,0,0,1]]}]}");
  EXPECT_EQ(readCameraFile(folder()).size(), 1u);
}

TEST_F(Colmap, TakesModelsWhoseDistortionIsZero) {
  storeText("7 SIMPLE_RADIAL 640 480 500 320.25 240.5 0\n3 OPENCV 100 50 80 90 51 24 0 0 0 0\n");
  expectBoth(readCameraFile(folder()));
}

TEST_F(Colmap, RefusesDistortedAndUnknownModelsByName) {
  const auto refused = [&](const std::string& line, std::initializer_list<const char*> texts) {
    storeText("7 SIMPLE_PINHOLE 640 480 500 320 240\n" + line);
    expectError(ErrorCode::kUnsupported, texts, [&] { readCameraFile(folder()); });
  };
  refused("3 SIMPLE_RADIAL 100 50 80 51 24 0.01", {"cameras.txt: camera 3", "SIMPLE_RADIAL"});
  refused("3 OPENCV 100 50 80 90 51 24 0 0 0 -0.1", {"camera 3", "OPENCV", "undistort"});
  refused("3 OPENCV_FISHEYE 100 50 80 90 51 24 0 0 0 0", {"camera 3", "OPENCV_FISHEYE"});
  refused("3 FOV 100 50 80 90 51 24 0.5", {"camera 3", "FOV"});
  refused("3 EQUIRECTANGULAR 100 50", {"camera 3", "EQUIRECTANGULAR", "PINHOLE"});
  storeBinary();
  std::string bytes = cameras();
  bytes[12] = 40;
  store("cameras.bin", bytes);
  expectError(ErrorCode::kUnsupported, {"cameras.bin: camera 7", "model 40"},
              [&] { readCameraFile(folder()); });
}

TEST_F(Colmap, EveryTruncatedPrefixIsRefusedWithItsOffset) {
  storeBinary();
  for (size_t length = 0; length < cameras().size(); ++length) {
    store("cameras.bin", cameras().substr(0, length));
    expectError(ErrorCode::kFormat,
                {"cameras.bin ends at byte", std::to_string(length).c_str(), "needs"},
                [&] { readCameraFile(folder()); });
  }
  store("cameras.bin", cameras());
  for (size_t length = 0; length < images().size(); ++length) {
    store("images.bin", images().substr(0, length));
    expectError(ErrorCode::kFormat, {"images.bin", "byte"}, [&] { readCameraFile(folder()); });
  }
}

TEST_F(Colmap, RefusesCountsThatLie) {
  storeBinary();
  std::string bytes = cameras();
  bytes[5] = 1;  // 2^40 cameras more
  store("cameras.bin", bytes);
  expectError(ErrorCode::kFormat, {"cameras.bin ends at byte", "a camera's number"},
              [&] { readCameraFile(folder()); });
  store("cameras.bin", cameras());
  bytes = images();
  const size_t points = bytes.find("view.png") + 9;
  bytes[points + 7] = '\xff';
  store("images.bin", bytes);
  expectError(ErrorCode::kFormat, {"images.bin", "second view.png", "points of 24 bytes"},
              [&] { readCameraFile(folder()); });
  bytes.assign(images(), 0, 8 + 4 + 56 + 4);
  bytes += std::string(10000, 'a');
  store("images.bin", bytes);
  expectError(ErrorCode::kFormat, {"images.bin", "longer than 4096"},
              [&] { readCameraFile(folder()); });
}

TEST_F(Colmap, SaysItInOneLineWhateverANameHolds) {
  std::string broken = images();
  broken.replace(broken.find("second view"), 11, "second\n\x1b\r\tv");
  storeBinary();
  store("images.bin", broken.substr(0, broken.find("\tv.png") + 20));
  expectError(ErrorCode::kFormat, {"images.bin", "'second????v.png'"},
              [&] { readCameraFile(folder()); });
}

TEST_F(Colmap, NamesTheFaultOfEachLine) {
  const auto refused = [&](const std::string& cameras, const std::string& images,
                           std::initializer_list<const char*> texts) {
    storeText(cameras, images);
    expectError(ErrorCode::kFormat, texts, [&] { readCameraFile(folder()); });
  };
  const std::string good_images = kTextImages;
  refused("7 PINHOLE 640 480 500 x 1 1", good_images, {"cameras.txt: line 1", "'x'"});
  refused("7 PINHOLE 640 480 500 500 1", good_images, {"cameras.txt: line 1", "''"});
  refused("7 PINHOLE 640 480 500 nan 1 1\n3 PINHOLE 10 10 1 1 1 1", good_images,
          {"camera 7", "not a finite number"});
  refused("7 PINHOLE 640 480.5 500 500 1 1\n3 PINHOLE 10 10 1 1 1 1", good_images,
          {"camera 7", "480.5", "65536"});
  refused("7 PINHOLE 640 480 0 500 1 1\n3 PINHOLE 10 10 1 1 1 1", good_images,
          {"camera 7", "focal", "positive"});
  refused("7 PINHOLE 640 480 500 1e300 1 1\n3 PINHOLE 10 10 1 1 1 1", good_images,
          {folder().c_str(), "view 0", "focal length is 1e+300", "at most 1e9"});
  refused("7 PINHOLE 640 480 500 500 1e308 1\n3 PINHOLE 10 10 1 1 1 1", good_images,
          {folder().c_str(), "view 0", "camera.cx is 1e+308"});
  refused(kTextCameras, "11 1 0 0 0 1e200 2 3 3 a.png\n\n",
          {"view 0 ('a.png')", "translation", "1e+200"});
  refused("7 PINHOLE 640 480 500 500 1 1", good_images, {"images.txt", "uses camera 3"});
  refused(kTextCameras, "11 0 0 0 0 1 2 3 3 a.png\n\n", {"'a.png'", "zero quaternion"});
  refused(kTextCameras, "11 1 0 0 0 inf 2 3 3 a.png\n\n", {"'a.png'", "finite"});
  refused(kTextCameras, "11 1 0 0 0 1 2 3 3\n\n", {"images.txt: line 1", "no name"});
  refused(kTextCameras, "# nothing\n", {"images.txt", "at least one"});
}

TEST_F(Colmap, NamesTheFileThatIsMissing) {
  store("images.bin", images());
  expectError(ErrorCode::kIo, {"cameras.bin", "cannot be opened"},
              [&] { readCameraFile(folder()); });
}

}  // namespace
}  // namespace stipple
