#include "io/views/dataset.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include "data/views/view_check.h"
#include "dataset_scene.h"

namespace stipple {
namespace {

class DatasetTest : public DatasetScene {
 protected:
  /// Three pictures with points, as COLMAP leaves them.
  void storeScene() const {
    storeColmap("PINHOLE 4 2 3 3 2 1", {"b.png", "a.png", "sub/c.png"});
    for (const char* name : {"a", "b", "sub/c"}) {
      const float value = (name[0] == 'a' ? 51.0f : name[0] == 'b' ? 102.0f : 204.0f) / 255.0f;
      storeGrey(std::string("images/") + name + ".png", value);
    }
    store("sparse/0/points3D.txt", "# points\n5 1 2 3 255 0 128 0.1 1 0 2 4\n9 0 0 2 0 0 0 0.2\n");
  }
};

TEST_F(DatasetTest, ReadsAColmapFolder) {
  storeScene();
  const auto dataset = openDataset(folder());
  ASSERT_EQ(dataset->count(), 3u);
  EXPECT_EQ(dataset->name(0), "a.png");
  EXPECT_EQ(dataset->name(2), "sub/c.png");
  EXPECT_EQ(dataset->colourSpace(), ColourSpace::kDisplay);
  EXPECT_EQ(dataset->camera(1).fx, 3);
  const ViewPicture picture = dataset->load(1);
  validateView(dataset->camera(1), picture, "b");
  EXPECT_EQ(picture.colour, std::vector<float>(24, 102.0f / 255.0f));
  EXPECT_TRUE(picture.alpha.empty());
  EXPECT_TRUE(picture.weights.empty());
  EXPECT_TRUE(picture.depth.empty());
  ASSERT_EQ(dataset->points().size(), 2u);
  EXPECT_EQ(dataset->points().positions, (std::vector<float>{1, 2, 3, 0, 0, 2}));
  EXPECT_EQ(dataset->points().colours[0], 1.0f);
  // sRGB 128 is linear 0.2158605; pow in float32 leaves 1e-6.
  EXPECT_NEAR(dataset->points().colours[2], 0.2158605f, 1e-6f);
  EXPECT_TRUE(checkViews(*dataset).empty());
}

TEST_F(DatasetTest, FindsPicturesAroundAColmapModel) {
  storeColmap("PINHOLE 4 2 3 3 2 1", {"a.png"}, "colmap/sparse/0");
  storeGrey("images/a.png", 1);
  for (const char* name : {"", "colmap", "colmap/sparse/0", "colmap/sparse/0/images.txt"}) {
    EXPECT_EQ(openDataset(path(name))->load(0).colour[0], 1.0f) << name;
  }
  storeColmap("PINHOLE 4 2 3 3 2 1", {"a.png"}, "flat");
  storeGrey("flat/a.png", 0);
  EXPECT_EQ(openDataset(path("flat"))->load(0).colour[0], 0.0f);
}

TEST_F(DatasetTest, ReadsBinaryPointsLikeText) {
  storeScene();
  std::filesystem::remove(path("sparse/0/points3D.txt"));
  ByteText bytes;
  const auto f64 = [&bytes](double value) { bytes.u64(std::bit_cast<uint64_t>(value)); };
  bytes.u64(2);
  bytes.u64(5);
  for (const double value : {1.0, 2.0, 3.0}) f64(value);
  bytes.u8(255).u8(0).u8(128);
  f64(0.1);
  bytes.u64(2).u32(1).u32(0).u32(2).u32(4);
  bytes.u64(9);
  for (const double value : {0.0, 0.0, 2.0}) f64(value);
  bytes.u8(0).u8(0).u8(0);
  f64(0.2);
  bytes.u64(0);
  store("sparse/0/points3D.bin", bytes.bytes);
  EXPECT_EQ(openDataset(folder())->points().positions, (std::vector<float>{1, 2, 3, 0, 0, 2}));
  for (size_t length = 0; length < bytes.bytes.size(); ++length) {
    store("sparse/0/points3D.bin", bytes.bytes.substr(0, length));
    expectError(ErrorCode::kFormat, {"points3D.bin", "byte"}, [&] { openDataset(folder()); });
  }
}

TEST_F(DatasetTest, ReadsNeRFSyntheticWithItsSplits) {
  const auto rgba = [](uint32_t x, uint32_t, uint32_t c) {
    // Premultiplied as Image has it: straight 0.4 where alpha is 0.6.
    return x == 0 ? 0.0f : (c == 3 ? 0.6f : 0.4f * 0.6f);
  };
  for (const char* split : {"train", "test", "val"}) {
    const std::string name = std::string(split) + "/r_0";
    storeImage(name + ".png", image(6, 4, 4, rgba));
    storeTransforms("\"camera_angle_x\": 1.0, ", frame("./" + name),
                    std::string("transforms_") + split + ".json");
  }
  const auto dataset = openDataset(folder());
  ASSERT_EQ(dataset->count(), 3u);
  EXPECT_EQ(dataset->role(0), ViewRole::kTrain);
  EXPECT_EQ(dataset->role(1), ViewRole::kTest);
  EXPECT_EQ(dataset->role(2), ViewRole::kValidation);
  const Camera& camera = dataset->camera(0);
  EXPECT_EQ(camera.width, 6u);
  EXPECT_EQ(camera.height, 4u);
  EXPECT_DOUBLE_EQ(camera.fx, 3 / std::tan(0.5));
  EXPECT_DOUBLE_EQ(camera.fy, camera.fx);
  EXPECT_EQ(camera.cy, 2);
  const ViewPicture picture = dataset->load(0);
  validateView(camera, picture, "r_0");
  EXPECT_EQ(picture.alpha[0], 0.0f);
  EXPECT_NEAR(picture.alpha[1], 0.6f, 1e-6f);
  // 102 / 255 of 153 / 255, kept in 16 bits.
  EXPECT_NEAR(picture.colour[3], 0.24f, 1.0f / 131070);
  EXPECT_EQ(openDataset(path("transforms_test.json"))->count(), 1u);
}

TEST_F(DatasetTest, ReadsTransformsWithMasksDepthsAndPoints) {
  storeGrey("images/0.png", 0.2f);
  storeGrey("images/1.png", 0.2f);
  storeImage("hide.png",
             image(4, 2, 1, [](uint32_t x, auto, auto) { return x < 2 ? 0.0f : 1.0f; }));
  storeTiff16("depth.tif", 2, 1, {1500, 0});
  store("points.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty "
        "float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
        "1 2 3 255 255 0\n");
  storeTransforms(
      "\"fl_x\": 4, \"w\": 4, \"h\": 2, \"ply_file_path\": \"points.ply\", \"test_filenames\": "
      "[\"images/1.png\"], ",
      frame("images/0.png", "\"mask_path\": \"hide.png\", \"depth_file_path\": \"depth.tif\", ") +
          "," + frame("images/1.png"));
  const auto dataset = openDataset(folder());
  const ViewPicture picture = dataset->load(0);
  EXPECT_EQ(picture.weights, (std::vector<float>{0, 0, 1, 1, 0, 0, 1, 1}));
  // Millimetres, of the nearest of fewer pixels; 0 is unknown.
  const float expected[8] = {1.5f, 1.5f, 0, 0, 1.5f, 1.5f, 0, 0};
  ASSERT_EQ(picture.depth.size(), 8u);
  // Two roundings, of the share of 65535 and of the product.
  for (size_t i = 0; i < 8; ++i) EXPECT_NEAR(picture.depth[i], expected[i], 3e-7f);
  EXPECT_TRUE(dataset->load(1).weights.empty());
  EXPECT_EQ(dataset->role(1), ViewRole::kTest);
  EXPECT_EQ(dataset->points().positions, (std::vector<float>{1, 2, 3}));
  EXPECT_EQ(dataset->points().colours, (std::vector<float>{1, 1, 0}));
}

TEST_F(DatasetTest, FindsMasksBesideThePictures) {
  storeScene();
  const auto half = [](uint32_t x, auto, auto) { return x < 2 ? 0.0f : 1.0f; };
  storeImage("masks/a.png.png", image(4, 2, 1, half));
  storeImage("masks/sub/c.png", image(4, 2, 3, half));
  const auto dataset = openDataset(folder());
  EXPECT_EQ(dataset->load(0).weights, (std::vector<float>{0, 0, 1, 1, 0, 0, 1, 1}));
  EXPECT_TRUE(dataset->load(1).weights.empty());
  EXPECT_EQ(dataset->load(2).weights[3], 1.0f);
  EXPECT_EQ(dataset->load(2).weights[0], 0.0f);
}

TEST_F(DatasetTest, MakesPicturesSmallerByTheMeanOfWhatCounts) {
  storeColmap("PINHOLE 6 4 5 5 3 2", {"a.png"});
  const auto values = [](uint32_t x, uint32_t y, auto) {
    return static_cast<float>(10 * (y * 6 + x)) / 255.0f;
  };
  storeImage("images/a.png", image(6, 4, 3, values));
  const auto dataset = openDataset(folder(), {.downscale = 2});
  EXPECT_EQ(dataset->camera(0).width, 3u);
  EXPECT_EQ(dataset->camera(0).height, 2u);
  EXPECT_EQ(dataset->camera(0).fx, 2.5);
  EXPECT_EQ(dataset->camera(0).cy, 1);
  // The mean of 0, 10, 60 and 70, kept in 16 bits.
  EXPECT_NEAR(dataset->load(0).colour[0], 35.0f / 255.0f, 1.0f / 131070);

  // Without the two left pixels of the first box: the mean of 10 and 70.
  storeImage("masks/a.png",
             image(6, 4, 1, [](uint32_t x, auto, auto) { return x == 0 ? 0.f : 1.f; }));
  const ViewPicture masked = openDataset(folder(), {.downscale = 2})->load(0);
  EXPECT_NEAR(masked.weights[0], 0.5f, 1.0f / 131070);
  EXPECT_EQ(masked.weights[1], 1.0f);
  EXPECT_NEAR(masked.colour[0], 40.0f / 255.0f, 1.0f / 131070);
}

TEST_F(DatasetTest, KeepsSixteenBitsAndFloats) {
  storeColmap("PINHOLE 2 1 3 3 1 0.5", {"a.tif"});
  makeFolder("images");
  storeTiff16("images/a.tif", 2, 1, {12345, 65535});
  const ViewPicture deep = openDataset(folder())->load(0);
  EXPECT_EQ(deep.colour[0], 12345.0f / 65535.0f);
  EXPECT_EQ(deep.colour[3], 1.0f);

  storeColmap("PINHOLE 2 1 3 3 1 0.5", {"b.exr"});
  storeImage("images/b.exr",
             image(
                 2, 1, 3, [](uint32_t x, auto, auto) { return x == 0 ? 7.25f : 0.1f; },
                 Transfer::kLinear));
  const auto linear = openDataset(folder());
  EXPECT_EQ(linear->colourSpace(), ColourSpace::kLinear);
  EXPECT_EQ(linear->load(0).colour, (std::vector<float>{7.25f, 7.25f, 7.25f, 0.1f, 0.1f, 0.1f}));

  // The first picture decides; others follow it.
  storeColmap("PINHOLE 2 1 3 3 1 0.5", {"a.tif", "b.exr"});
  const auto mixed = openDataset(folder());
  EXPECT_EQ(mixed->colourSpace(), ColourSpace::kDisplay);
  EXPECT_NEAR(mixed->load(1).colour[3], 1.055 * std::pow(0.1, 1 / 2.4) - 0.055, 1e-6);
}

TEST_F(DatasetTest, NamesWhatIsMissing) {
  storeScene();
  std::filesystem::remove(path("images/b.png"));
  expectError(ErrorCode::kIo, {"1 of 3 images is missing", "images/b.png", "at least 3"},
              [&] { openDataset(folder()); });
  std::filesystem::remove_all(path("images"));
  expectError(ErrorCode::kIo, {"the image 'a.png' is missing", "images"},
              [&] { openDataset(folder()); });
  storeTransforms("\"camera_angle_x\": 1.0, ", frame("no/picture") + "," + frame("none"));
  expectError(ErrorCode::kIo, {"2 of 2 images are missing", "no/picture"},
              [&] { openDataset(folder()); });
  storeGrey("images/0.png", 0.2f);
  storeTransforms("\"camera_angle_x\": 1.0, ", frame("images/0", "\"mask_path\": \"m.png\", "));
  expectError(ErrorCode::kIo, {"m.png"}, [&] { openDataset(folder()); });
  storeTransforms("\"camera_angle_x\": 1.0, ", frame(""));
  expectError(ErrorCode::kFormat, {"frame 0", "file_path"}, [&] { openDataset(folder()); });
  storeTransforms("\"camera_angle_x\": 1.0, \"ply_file_path\": \"p.ply\", ", frame("images/0"));
  expectError(ErrorCode::kIo, {"p.ply"}, [&] { openDataset(folder()); });
  expectError(ErrorCode::kInvalidArgument, {"downscale is 0"},
              [&] { openDataset(folder(), {.downscale = 0}); });
}

TEST_F(DatasetTest, LeavesOutViewsWhoseImagesWereDeleted) {
  makeFolder("images");
  for (const char* name : {"1", "2", "3"}) storeGrey("images/" + std::string(name) + ".png", 0.2f);
  storeTransforms("\"camera_angle_x\": 1.0, ", frame("images/0") + "," + frame("images/1") + "," +
                                                   frame("images/2") + "," + frame("images/3"));
  const auto dataset = openDataset(folder());
  ASSERT_EQ(dataset->count(), 3u);
  EXPECT_EQ(dataset->name(0), "images/1");
  ASSERT_EQ(dataset->notes().size(), 1u);
  EXPECT_NE(dataset->notes()[0].find("1 of 4 images is missing"), std::string::npos);
  EXPECT_NE(dataset->notes()[0].find("left out"), std::string::npos);

  // Of COLMAP's, too, where the first is missing.
  storeColmap("PINHOLE 2 1 3 3 1 0.5", {"0.png", "1.png", "2.png", "3.png"});
  std::filesystem::remove(path("transforms.json"));
  EXPECT_EQ(openDataset(folder())->count(), 3u);
}

TEST_F(DatasetTest, NamesPicturesOfAnotherSizeAndBrokenOnes) {
  storeScene();
  storeGrey("images/a.png", 1, 5, 2);
  const auto dataset = openDataset(folder());
  expectError(ErrorCode::kFormat,
              {"images/a.png is 5 x 2 pixels; its camera is said to be 4 x 2 pixels"},
              [&] { dataset->load(0); });
  const std::string whole = load(path("images/b.png"));
  store("images/b.png", whole.substr(0, whole.size() / 2));
  expectError(ErrorCode::kFormat, {"images/b.png"}, [&] { dataset->load(1); });
  storeGrey("masks/sub/c.png", 1, 2, 2);
  expectError(ErrorCode::kFormat, {"masks/sub/c.png is 2 x 2 pixels"},
              [&] { openDataset(folder())->load(2); });
  std::filesystem::remove(path("images/sub/c.png"));
  expectError(ErrorCode::kIo, {"images/sub/c.png", "No such file"}, [&] { dataset->load(2); });
  expectError(ErrorCode::kInvalidArgument, {"view 3", "3 views"}, [&] { dataset->load(3); });
}

TEST_F(DatasetTest, NamesThePixelOfAnExrThatIsNotANumber) {
  storeColmap("PINHOLE 300 200 300 300 150 100", {"a.exr"});
  Image bad = image(
      300, 200, 3, [](auto, auto, auto) { return 0.5f; }, Transfer::kLinear);
  bad.pixels[(199 * 300 + 7) * 3 + 2] = std::numeric_limits<float>::quiet_NaN();
  storeImage("images/a.exr", bad);
  const auto dataset = openDataset(folder());
  expectError(ErrorCode::kInvalidArgument, {"images/a.exr: pixel (7, 199) holds nan"},
              [&] { dataset->load(0); });
}

TEST_F(DatasetTest, RefusesAJpegThatIsCutOff) {
  // 16 x 16 grey noise, written by oiiotool 2.4 without metadata.
  static constexpr char kHex[] =
      "ffd8ffe000104a46494600010100000100010000ffdb0043001b12141714111b1716171e1c1b2028422b28252528"
      "513a3d3042605565645f555d5b6a7899816a7190735b5d85b586909ea3abadab6780bcc9baa6c799a8aba4ffc000"
      "0b080010001001011100ffc4001f0000010501010101010100000000000000000102030405060708090a0bffc400"
      "b5100002010303020403050504040000017d01020300041105122131410613516107227114328191a1082342b1c1"
      "1552d1f02433627282090a161718191a25262728292a3435363738393a434445464748494a535455565758595a63"
      "6465666768696a737475767778797a838485868788898a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6"
      "b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8f9faffda0008"
      "010100003f005b46db216631315f979002a81d0f3d0f24638e076ef2bc8e6d9642a87046474c919c60f39ce08f7c"
      "9e78c98635b89590809b9d9083192c0005893839ff0011c7bd3265863599a2f35930115586dc0e7b13fef76fd6bf"
      "ffd9";
  std::string jpeg;
  for (size_t i = 0; i + 1 < sizeof(kHex); i += 2) {
    jpeg.push_back(static_cast<char>(std::stoi(std::string(kHex + i, 2), nullptr, 16)));
  }
  storeColmap("PINHOLE 16 16 16 16 8 8", {"a.jpg"});
  makeFolder("images");
  store("images/a.jpg", jpeg);
  const auto dataset = openDataset(folder(), {.cache_bytes = 0});
  EXPECT_EQ(dataset->load(0).colour.size(), 16u * 16 * 3);
  // What other programs append does no harm.
  store("images/a.jpg", jpeg + "appended");
  EXPECT_EQ(dataset->load(0).colour.size(), 16u * 16 * 3);
  for (const size_t cut : {size_t{1}, size_t{2}, size_t{20}, jpeg.size() / 2}) {
    store("images/a.jpg", jpeg.substr(0, jpeg.size() - cut));
    expectError(ErrorCode::kFormat, {"images/a.jpg"}, [&] { dataset->load(0); });
  }
}

TEST_F(DatasetTest, StreamsTenThousandPicturesInBoundedMemory) {
  storeGrey("0.png", 0.2f, 32, 32);
  constexpr size_t kCount = 10000;
  std::string frames;
  for (size_t i = 0; i < kCount; ++i) {
    const std::string name = std::to_string(i) + ".png";
    if (i > 0) std::filesystem::create_symlink(path("0.png"), path(name));
    if (i > 0) frames += ",";
    frames += frame(name);
  }
  storeTransforms("\"fl_x\": 40, \"w\": 32, \"h\": 32, ", frames);
  constexpr uint64_t kLimit = 100000;  // 16 pictures of 6 KiB
  const auto dataset = openDataset(folder(), {.cache_bytes = kLimit});
  ASSERT_EQ(dataset->count(), kCount);
  uint64_t sum = 0;
  for (size_t i = 0; i < 400; ++i) {
    sum += dataset->load(i * 4999 % kCount).colour.size();
    ASSERT_LE(dataset->cachedBytes(), kLimit);
  }
  EXPECT_EQ(sum, 400u * 32 * 32 * 3);
  EXPECT_GT(dataset->cachedBytes(), kLimit * 9 / 10);
}

TEST_F(DatasetTest, GivesTheSameToManyThreadsAndWithoutACache) {
  std::string frames;
  for (uint32_t i = 0; i < 8; ++i) {
    const std::string name = std::to_string(i) + ".png";
    storeImage(name, image(33, 21, 4, [i](uint32_t x, uint32_t y, uint32_t c) {
                 return c == 3 ? 0.8f : 0.8f * static_cast<float>((x * 7 + y * 3 + i) % 11) / 11.0f;
               }));
    if (i > 0) frames += ",";
    frames += frame(name);
  }
  storeTransforms("\"fl_x\": 30, \"w\": 33, \"h\": 21, \"k1\": -0.1, ", frames);
  const auto kept = openDataset(folder(), {.downscale = 2});
  const auto read_again = openDataset(folder(), {.downscale = 2, .cache_bytes = 0});
  std::vector<ViewPicture> seen(64);
  std::vector<std::thread> threads;
  for (size_t t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (size_t i = t; i < seen.size(); i += 4) seen[i] = kept->load(i % 8);
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (size_t i = 0; i < seen.size(); ++i) {
    const ViewPicture alone = read_again->load(i % 8);
    EXPECT_EQ(seen[i].colour, alone.colour);
    EXPECT_EQ(seen[i].alpha, alone.alpha);
    EXPECT_EQ(seen[i].weights, alone.weights);
    // Packed at once, or anew from what was unpacked: the numbers are the same.
    for (const Dataset* set : {kept.get(), read_again.get()}) {
      const ViewPicture packed = set->packed(i % 8)->unpacked();
      EXPECT_EQ(packed.colour, alone.colour);
      EXPECT_EQ(packed.alpha, alone.alpha);
      EXPECT_EQ(packed.weights, alone.weights);
    }
  }
  EXPECT_EQ(read_again->cachedBytes(), 0u);
}

}  // namespace
}  // namespace stipple
