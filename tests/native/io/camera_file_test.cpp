#include "io/views/camera_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "scratch_folder.h"

namespace stipple {
namespace {

class CameraFile : public ScratchFolder {
 protected:
  std::vector<CameraView> read(const std::string& json) {
    return readCameraFile(store("transforms.json", json));
  }
  CameraView readOne(const std::string& keys, const std::string& frame_keys = "") {
    const auto views = read("{" + keys + (keys.empty() ? "" : ",") + "\"frames\": [{" + frame_keys +
                            (frame_keys.empty() ? "" : ",") + kPose + "}]}");
    EXPECT_EQ(views.size(), 1u);
    return views.at(0);
  }
  // At (1, 2, 3), looking along +y with z up: x right, y up = +z, −z forward = +y.
  static constexpr char kPose[] =
      "\"transform_matrix\": [[1,0,0,1],[0,0,-1,2],[0,1,0,3],[0,0,0,1]]";
};

TEST_F(CameraFile, TurnsOpenGlFramesIntoOpenCv) {
  const Camera camera = readOne("\"fl_x\": 500, \"w\": 640, \"h\": 480").camera;
  validate(camera);
  EXPECT_TRUE(cameraCentre(camera).isApprox(Vec3d(1, 2, 3), 1e-12));
  const auto see = [&](double x, double y, double z) {
    const Vec4d seen = camera.world_to_camera * Vec4d(x, y, z, 1);
    return Vec3d(seen.head<3>());
  };
  // Five metres ahead, one to the right and one up: y is down in the picture.
  EXPECT_TRUE(see(1, 7, 3).isApprox(Vec3d(0, 0, 5), 1e-12));
  EXPECT_TRUE(see(2, 7, 3).isApprox(Vec3d(1, 0, 5), 1e-12));
  EXPECT_TRUE(see(1, 7, 4).isApprox(Vec3d(0, -1, 5), 1e-12));
}

TEST_F(CameraFile, ReadsNerfstudioIntrinsicsAndLetsFramesOverride) {
  const auto view = readOne(
      "\"fl_x\": 500, \"fl_y\": 510, \"cx\": 300.5, \"cy\": 250, \"w\": 640,"
      "\"h\": 480, \"k1\": 0.0, \"camera_model\": \"OPENCV\"",
      "\"file_path\": \"images/a.png\", \"fl_x\": 123.25");
  EXPECT_EQ(view.image_path, "images/a.png");
  EXPECT_EQ(view.camera.width, 640u);
  EXPECT_EQ(view.camera.height, 480u);
  EXPECT_EQ(view.camera.fx, 123.25);
  EXPECT_EQ(view.camera.fy, 510);
  EXPECT_EQ(view.camera.cx, 300.5);
  EXPECT_EQ(view.camera.cy, 250);
}

TEST_F(CameraFile, ReadsWhenAPictureWasTaken) {
  EXPECT_EQ(readOne("\"fl_x\": 500, \"w\": 640, \"h\": 480").time, 0);
  EXPECT_EQ(readOne("\"camera_angle_x\": 1.2", "\"time\": 0.25").time, 0.25);
  EXPECT_EQ(readOne("\"camera_angle_x\": 1.2, \"time\": 3", "\"time\": -1.5").time, -1.5);
  expectError(ErrorCode::kFormat, {"frame 0", "'time'"},
              [&] { readOne("\"camera_angle_x\": 1.2", "\"time\": \"noon\""); });
}

TEST_F(CameraFile, ReadsAnglesWithAndWithoutASize) {
  const Camera sized = readOne("\"camera_angle_x\": 1.2, \"w\": 800, \"h\": 600").camera;
  EXPECT_DOUBLE_EQ(sized.fx, 400.0 / std::tan(0.6));
  EXPECT_EQ(sized.fy, sized.fx);
  EXPECT_EQ(sized.cx, 400);
  EXPECT_EQ(sized.cy, 300);
  const Camera synthetic = readOne("\"camera_angle_x\": 1.2").camera;
  EXPECT_EQ(synthetic.width, 0u);
  EXPECT_EQ(synthetic.height, 0u);
  EXPECT_DOUBLE_EQ(synthetic.fx, 0.5 / std::tan(0.6));
  EXPECT_EQ(synthetic.cx, 0.5);
  EXPECT_EQ(synthetic.cy, 0.5);
}

TEST_F(CameraFile, ReadsOrthographicCameras) {
  const std::string model = "\"camera_model\": \"ORTHOGRAPHIC\", \"ortho_scale\": 4";
  const Camera sized = readOne(model + ", \"w\": 800, \"h\": 600").camera;
  EXPECT_EQ(sized.model, CameraModel::kOrthographic);
  EXPECT_EQ(sized.fx, 200);
  EXPECT_EQ(sized.fy, 200);
  EXPECT_EQ(readOne(model).camera.fx, 0.25);
}

TEST_F(CameraFile, ReadsPanoramasAndFisheyes) {
  const std::string size = ", \"w\": 800, \"h\": 400";
  const Camera panorama =
      readOne("\"camera_model\": \"EQUIRECTANGULAR\", \"fl_x\": 400" + size).camera;
  EXPECT_EQ(panorama.model, CameraModel::kEquirectangular);
  // The whole sphere.
  EXPECT_DOUBLE_EQ(panorama.fx, 400 / M_PI);
  EXPECT_DOUBLE_EQ(panorama.fy, 400 / M_PI);
  EXPECT_EQ(panorama.cx, 400);
  const Camera fisheye =
      readOne("\"camera_model\": \"FISHEYE_EQUISOLID\", \"fl_x\": 150, \"field_of_view\": 3.1" +
              size)
          .camera;
  EXPECT_EQ(fisheye.model, CameraModel::kFisheyeEquisolid);
  EXPECT_EQ(fisheye.fx, 150);
  EXPECT_EQ(fisheye.fy, 150);
  EXPECT_EQ(fisheye.field_of_view, 3.1);
  expectError(ErrorCode::kFormat, {"view 0", "field of view is 400", "360"}, [&] {
    readOne("\"camera_model\": \"FISHEYE_EQUIDISTANT\", \"fl_x\": 99, \"field_of_view\": 6.981317" +
            size);
  });
}

TEST_F(CameraFile, TakesTheScaleOfACameraAway) {
  const auto views = read(
      "{\"camera_angle_x\": 1, \"frames\": [{\"transform_matrix\":"
      "[[0,-2,0,1],[2,0,0,2],[0,0,2,3]]}]}");
  const Mat3d rotation = views[0].camera.world_to_camera.topLeftCorner<3, 3>();
  EXPECT_TRUE((rotation * rotation.transpose()).isApprox(Mat3d::Identity(), 1e-12));
  EXPECT_TRUE(cameraCentre(views[0].camera).isApprox(Vec3d(1, 2, 3), 1e-12));
}

TEST_F(CameraFile, RefusesDistortedModels) {
  const std::string size = "\"fl_x\": 500, \"w\": 640, \"h\": 480, ";
  expectError(ErrorCode::kUnsupported, {"frame 0", "k1 = 0.1", "undistort"},
              [&] { readOne(size + "\"k1\": 0.1"); });
  expectError(ErrorCode::kUnsupported, {"OPENCV_FISHEYE"},
              [&] { readOne(size + "\"camera_model\": \"OPENCV_FISHEYE\""); });
  expectError(ErrorCode::kUnsupported, {"fisheye"},
              [&] { readOne(size + "\"is_fisheye\": true"); });
}

TEST_F(CameraFile, SaysWhatIsWrong) {
  const auto refuse = [&](const std::string& json, std::initializer_list<const char*> texts) {
    expectError(ErrorCode::kFormat, texts, [&] { read(json); });
  };
  const std::string pose = kPose;
  const auto one = [&](const std::string& keys) {
    return "{" + keys + ", \"frames\": [{" + pose + "}]}";
  };
  refuse("", {"transforms.json", "JSON"});
  refuse("{\"frames\": [", {"JSON"});
  refuse("[1]", {"frames"});
  refuse("{\"frames\": []}", {"frames"});
  refuse("{\"frames\": [7]}", {"frame 0", "object"});
  refuse(one("\"w\": 640, \"h\": 480"), {"fl_x", "camera_angle_x"});
  refuse(one("\"fl_x\": 500"), {"fl_x", "size"});
  refuse(one("\"fl_x\": 500, \"w\": 640"), {"only one"});
  refuse(one("\"fl_x\": -5, \"w\": 640, \"h\": 480"), {"fl_x = -5", "positive"});
  refuse(one("\"fl_x\": 1e300, \"w\": 640, \"h\": 480"),
         {"transforms.json: view 0", "1e+300", "at most 1e9"});
  refuse(one("\"fl_x\": 500, \"cx\": 1e308, \"w\": 640, \"h\": 480"),
         {"transforms.json: view 0", "camera.cx is 1e+308", "-1e+12 to 1e+12"});
  refuse(one("\"fl_x\": 500, \"cy\": -1e13, \"w\": 640, \"h\": 480"), {"camera.cy is -1e+13"});
  refuse(one("\"fl_x\": \"5\", \"w\": 640, \"h\": 480"), {"fl_x", "number"});
  refuse(one("\"fl_x\": 5, \"w\": 64000000, \"h\": 480"), {"w = 64000000", "65536"});
  refuse(one("\"camera_angle_x\": 3.2"), {"camera_angle_x = 3.2", "pi"});
  refuse(one("\"camera_model\": \"ORTHOGRAPHIC\""), {"ortho_scale"});
  refuse("{\"camera_angle_x\": 1, \"frames\": [{}]}", {"frame 0", "transform_matrix"});
  refuse("{\"camera_angle_x\": 1, \"frames\": [{" + pose + "}, {\"transform_matrix\": [[1]]}]}",
         {"frame 1", "4 x 4"});
  refuse(
      "{\"camera_angle_x\": 1, \"frames\": [{\"transform_matrix\": "
      "[[1,1,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}",
      {"rotation"});
  refuse(
      "{\"camera_angle_x\": 1, \"frames\": [{\"transform_matrix\": "
      "[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}",
      {"rotation"});
  expectError(ErrorCode::kIo, {"No such file"}, [&] { readCameraFile(path("missing.json")); });
  std::filesystem::create_directory(path("empty"));
  expectError(ErrorCode::kFormat, {"empty", "holds no cameras"},
              [&] { readCameraFile(path("empty")); });
}

}  // namespace
}  // namespace stipple
