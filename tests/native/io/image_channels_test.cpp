#include "io/image_channels.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "io/image_file.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class ImageChannels : public ScratchFolder {
 protected:
  /// An EXR file of 37 x 600 pixels, whose values are their numbers.
  std::string stored(const char* name) {
    Image image;
    image.width = 37;
    image.height = 600;
    image.channels = 4;
    image.transfer = Transfer::kLinear;
    for (size_t i = 0; i < image.pixelCount() * 4; ++i) {
      image.pixels.push_back(static_cast<float>(i));
    }
    writeImageFile(image, path(name));
    return path(name);
  }
};

TEST_F(ImageChannels, ReadsEveryChannelByItsName) {
  const std::vector<ImageChannel> channels = readImageChannels(stored("a.exr"));
  ASSERT_EQ(channels.size(), 4u);
  const char* names[] = {"R", "G", "B", "A"};
  for (size_t c = 0; c < 4; ++c) {
    EXPECT_EQ(channels[c].name, names[c]);
    ASSERT_EQ(channels[c].width, 37u);
    ASSERT_EQ(channels[c].height, 600u);
    ASSERT_EQ(channels[c].values.size(), 37u * 600u);
    for (size_t i = 0; i < channels[c].values.size(); ++i) {
      ASSERT_EQ(channels[c].values[i], static_cast<float>(4 * i + c)) << i;
    }
  }
}

TEST_F(ImageChannels, RefusesOtherKindsOfFiles) {
  expectError(ErrorCode::kIo, {"none.exr"}, [&] { readImageChannels(path("none.exr")); });
  for (const std::string& bytes : {std::string(), std::string("12345678"),
                                   std::string("\x76\x2f\x31\x01\x02\0\0\0channels\0", 17)}) {
    const std::string file = store("a.exr", bytes);
    expectError(ErrorCode::kFormat, {"a.exr", "EXR"}, [&] { readImageChannels(file); });
  }
}

TEST_F(ImageChannels, RefusesWhatIsCutOff) {
  const std::string whole = load(stored("a.exr"));
  for (size_t length = 8; length + 1 < whole.size(); length += whole.size() / 13) {
    const std::string file = store("b.exr", whole.substr(0, length));
    expectError(ErrorCode::kFormat, {"b.exr"}, [&] { readImageChannels(file); });
  }
}

TEST_F(ImageChannels, RefusesMoreThanTheLimitBeforeItAllocates) {
  const uint64_t bytes = uint64_t{37} * 600 * 4 * sizeof(float);
  const std::string file = stored("a.exr");
  EXPECT_EQ(readImageChannels(file, bytes).size(), 4u);
  expectError(ErrorCode::kMemoryLimit, {"a.exr", std::to_string(bytes).c_str()},
              [&] { readImageChannels(file, bytes - 1); });
}

TEST_F(ImageChannels, RefusesWindowsThatNoFileFills) {
  std::string bytes = load(stored("a.exr"));
  for (const char* window : {"dataWindow", "displayWindow"}) {
    const size_t at = bytes.find(window);
    ASSERT_NE(at, std::string::npos);
    const size_t value = at + std::strlen(window) + 1 + std::strlen("box2i") + 1 + 4;
    // 65,536 pixels square: 64 GiB of four channels, in a file of some kilobytes.
    const int32_t corner = 65535;
    std::memcpy(&bytes[value + 8], &corner, 4);
    std::memcpy(&bytes[value + 12], &corner, 4);
  }
  const std::string file = store("b.exr", bytes);
  try {
    readImageChannels(file);
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    // The library of the format may refuse it first.
    EXPECT_TRUE(error.code() == ErrorCode::kMemoryLimit || error.code() == ErrorCode::kFormat)
        << error.what();
  }
}

}  // namespace
}  // namespace stipple
