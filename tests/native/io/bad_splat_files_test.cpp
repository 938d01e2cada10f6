// Damage of every kind, for every format: whatever a file holds, reading gives a valid cloud or one
// message. The sanitizer build runs the same tests.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "io/splats/sog_levels.h"
#include "io/splats/splat_file.h"
#include "ksplat_builder.h"
#include "random_cloud.h"
#include "scratch_folder.h"
#include "sog_scene.h"

namespace stipple {
namespace {

using Json = nlohmann::json;

struct Sample {
  std::string name;  ///< with the format's extension
  std::string bytes;
  bool is_folder = false;  ///< the file names others, which are there
};

class BadSplatFiles : public ScratchFolder {
 protected:
  /// A small valid file of every format that can be read.
  std::vector<Sample> samples() {
    std::vector<Sample> made;
    for (const int degree : {0, 2}) {
      const SplatCloud cloud = randomCloud(6, degree, 31);
      for (const SplatFormat& format : splatFormats()) {
        if (format.write == nullptr) continue;
        const std::string extensions = format.extensions;
        const std::string extension = extensions.substr(0, extensions.find(' '));
        if (extension[0] != '.') continue;
        add(made, cloud, {}, "degree" + std::to_string(degree) + extension);
      }
      add(made, cloud, {.version = 3}, "old" + std::to_string(degree) + ".spz");
      add(made, cloud, {.ascii = true}, "text" + std::to_string(degree) + ".ply");
    }
    for (unsigned level = 0; level < 3; ++level) {
      RawKsplat raw;
      raw.level = level;
      raw.degree = 1;
      made.push_back({"level" + std::to_string(level) + ".ksplat", raw.bytes()});
    }
    for (const Sample& sample : folderSamples()) made.push_back(sample);
    return made;
  }

  /// The JSON of scenes that are folders: SOG of both versions, and a streamed one with all it can
  /// name.
  std::vector<Sample> folderSamples() {
    SogScene::first().store(folder_ / "first");
    SogScene::second().store(folder_ / "second");
    std::filesystem::create_directories(folder_ / "levels");
    const SplatCloud fine = randomCloud(40, 1, 31), coarse = randomCloud(9, 0, 32);
    writeSogLevels({&fine, &coarse}, &coarse, path("levels/lod-meta.json"),
                   {.chunk_splats = 20, .chunk_side = 1e9}, nullptr);
    std::vector<Sample> made;
    for (const char* name : {"first/meta.json", "second/meta.json", "levels/lod-meta.json"}) {
      made.push_back({name, load(path(name)), true});
    }
    return made;
  }

  void add(std::vector<Sample>& made, const SplatCloud& cloud, const SplatWriteOptions& options,
           const std::string& name) {
    writeSplatFile(cloud, path(name), options);
    made.push_back({name, load(path(name))});
  }

  /// Reads a file of these bytes: a cloud without fault, or one sentence that names the file.
  /// Returns whether it was read.
  bool survives(const Sample& sample, const std::string& bytes) {
    store(sample.name, bytes);
    try {
      validate(readSplatFile(path(sample.name)), "cloud");
      return true;
    } catch (const Error& error) {
      const std::string message = error.what();
      // The fault may lie between a scene's JSON and a picture beside it, which may not be there.
      const std::string place =
          sample.is_folder ? std::filesystem::path(path(sample.name)).parent_path().string()
                           : sample.name;
      EXPECT_NE(message.find(place), std::string::npos) << message;
      EXPECT_EQ(message.find('\n'), std::string::npos) << message;
      EXPECT_TRUE(error.code() == ErrorCode::kFormat || error.code() == ErrorCode::kUnsupported ||
                  (sample.is_folder && error.code() == ErrorCode::kIo))
          << static_cast<int>(error.code()) << " " << message;
      return false;
    }
  }
};

TEST_F(BadSplatFiles, RefusesEveryTruncatedPrefix) {
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.name);
    ASSERT_TRUE(survives(sample, sample.bytes));
    // The last number of a text may lose digits unseen; whole records make a shorter .splat file.
    const bool records = sample.name.ends_with(".splat");
    const bool text = sample.name.starts_with("text");
    // Behind the last bracket of a layer of USD is the end of a line alone.
    const size_t whole = text                             ? sample.bytes.rfind(' ')
                         : sample.name.ends_with(".usda") ? sample.bytes.rfind('}')
                                                          : sample.bytes.size();
    // Long runs of zeros in headers: every byte near the ends, each seventh between.
    for (size_t size = 0; size < whole; size += size < 300 || whole - size < 300 ? 1 : 7) {
      EXPECT_EQ(survives(sample, sample.bytes.substr(0, size)),
                records && size > 0 && size % 32 == 0)
          << size << " of " << whole << " bytes";
    }
  }
}

TEST_F(BadSplatFiles, SurvivesEveryDamagedByte) {
  std::mt19937 random(32);
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.name);
    for (int trial = 0; trial < 400; ++trial) {
      std::string bytes = sample.bytes;
      const size_t changes = 1 + random() % 4;
      for (size_t c = 0; c < changes; ++c) {
        // Headers and tables stand in front: half of the damage goes there.
        const size_t range = random() % 2 == 0 ? std::min<size_t>(bytes.size(), 128) : bytes.size();
        const size_t at = random() % range;
        const unsigned kinds[] = {0, 255, 127, 128, static_cast<unsigned>(random() % 256)};
        bytes[at] = static_cast<char>(kinds[random() % 5]);
      }
      survives(sample, bytes);
    }
  }
}

TEST_F(BadSplatFiles, SurvivesNumbersOfAnySizeAtEveryPlace) {
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.name);
    for (size_t at = 0; at + 4 <= std::min<size_t>(sample.bytes.size(), 160); ++at) {
      for (const uint32_t value : {0xffffffffu, 0x80000000u, 0x7fffffffu, 0x7fc00000u}) {
        std::string bytes = sample.bytes;
        bytes.replace(at, 4, ByteText().u32(value).bytes);
        survives(sample, bytes);
      }
    }
  }
}

TEST_F(BadSplatFiles, SurvivesAnythingInThePlaceOfAnyValueOfAScene) {
  const Json others[] = {-1,   0,      0.5,  1e300,         -1e300,         uint64_t{1} << 40,
                         "..", "a\nb", true, Json::array(), Json::object(), nullptr};
  for (const Sample& sample : folderSamples()) {
    SCOPED_TRACE(sample.name);
    ASSERT_TRUE(survives(sample, sample.bytes));
    const Json good = Json::parse(sample.bytes);
    const Json places = good.flatten();
    size_t number = 0;
    for (const auto& [place, value] : places.items()) {
      // Of the 256 numbers of a codebook some are enough.
      if (place.find("codebook") != place.npos && ++number % 32 != 1) continue;
      for (const Json& other : others) {
        Json changed = good;
        changed[Json::json_pointer(place)] = other;
        survives(sample, changed.dump());
        changed[Json::json_pointer(place).parent_pointer()] = other;
        survives(sample, changed.dump());
      }
    }
  }
}

TEST_F(BadSplatFiles, LeavesTheOldFileWhereWritingFails) {
  for (const SplatFormat& format : splatFormats()) {
    if (format.write == nullptr) continue;
    const std::string extensions = format.extensions;
    const std::string extension = extensions.substr(0, extensions.find(' '));
    if (extension[0] != '.') continue;
    SCOPED_TRACE(extension);
    const std::string file = store("old" + extension, "old");
    const size_t before = fileCount();
    SplatCloud bad = randomCloud(5, 0, 33);
    bad.positions[3] = std::nanf("");
    expectError(ErrorCode::kInvalidArgument, {"position"}, [&] { writeSplatFile(bad, file, {}); });
    Progress progress;
    progress.cancel();
    expectError(ErrorCode::kCancelled, {},
                [&] { writeSplatFile(randomCloud(5, 0, 34), file, {}, &progress); });
    EXPECT_EQ(load(file), "old");
    EXPECT_EQ(fileCount(), before);
  }
}

}  // namespace
}  // namespace stipple
