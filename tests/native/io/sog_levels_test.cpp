#include "io/splats/sog_levels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "io/splats/sog_file.h"
#include "io/splats/splat_file.h"
#include "random_cloud.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

using Json = nlohmann::json;

class SogLevels : public ScratchFolder {
 protected:
  std::string meta() const { return path("lod-meta.json"); }
  Json json() const { return Json::parse(load(meta())); }

  /// Every chunk of a level: its bound, and its range in a file.
  static void visit(const Json& node, const std::function<void(const Json&)>& use) {
    if (node.contains("lods")) use(node);
    if (!node.contains("children")) return;
    for (const Json& child : node["children"]) visit(child, use);
  }

  void write(const std::vector<const SplatCloud*>& levels, const SplatCloud* environment = nullptr,
             SogLevelsOptions options = {.chunk_splats = 300, .chunk_side = 1e9}) const {
    writeSogLevels(levels, environment, meta(), options, nullptr);
  }

  void refused(const Json& changed, std::initializer_list<const char*> texts,
               ErrorCode code = ErrorCode::kFormat) const {
    store("lod-meta.json", changed.dump());
    expectError(code, texts, [&] { readSogLevels(meta(), nullptr); });
  }
};

/// What a splat is known by: its first coefficient.
std::vector<float> namesOf(const SplatCloud& cloud) {
  std::vector<float> names;
  for (size_t i = 0; i < cloud.size(); ++i) names.push_back(cloud.sh[i * cloud.shStride()]);
  std::sort(names.begin(), names.end());
  return names;
}

/// A cloud whose first coefficients are few enough to survive: 200 names.
SplatCloud named(size_t count, int degree, unsigned seed, float first) {
  SplatCloud cloud = randomCloud(count, degree, seed);
  for (size_t i = 0; i < count; ++i) {
    float* sh = &cloud.sh[i * cloud.shStride()];
    sh[0] = first + static_cast<float>(i % 200);
    sh[1] = sh[2] = 0.0f;
  }
  return cloud;
}

TEST_F(SogLevels, ReadsBackTheFinestLevelAndTheEnvironment) {
  const SplatCloud fine = named(2000, 2, 1, 0);
  const SplatCloud coarse = named(500, 1, 2, 1000);
  const SplatCloud sky = named(50, 0, 3, 2000);
  write({&fine, &coarse}, &sky);
  const SplatCloud back = readSplatFile(meta());
  validate(back, "back");
  EXPECT_EQ(back.sh_degree, 2);
  EXPECT_EQ(back.frame, Frame::kRDF);
  std::vector<float> expected = namesOf(fine);
  for (const float name : namesOf(sky)) expected.push_back(name);
  EXPECT_EQ(namesOf(back), expected);
  EXPECT_EQ(namesOf(readSplatFile(folder_.string())), expected);
}

TEST_F(SogLevels, CutsSpaceIntoChunksThatHoldTheirSplats) {
  const SplatCloud fine = named(2000, 0, 4, 0);
  const SplatCloud coarse = named(400, 0, 5, 1000);
  write({&fine, &coarse});
  const Json meta = json();
  EXPECT_EQ(meta["version"], 1);
  EXPECT_EQ(meta["count"], 2400);
  EXPECT_EQ(meta["counts"], Json({2000, 400}));
  EXPECT_EQ(meta["lodLevels"], 2);
  size_t chunks = 0;
  size_t splats[2] = {};
  visit(meta["tree"], [&](const Json& node) {
    ++chunks;
    size_t together = 0;
    for (const auto& [level, range] : node["lods"].items()) {
      const std::string name = meta["filenames"][size_t(range["file"])];
      EXPECT_EQ(name[0], level[0]);
      const SplatCloud cloud = readSog(path(name), nullptr);
      const size_t offset = range["offset"], count = range["count"];
      ASSERT_LE(offset + count, cloud.size());
      together += count;
      splats[std::stoul(level)] += count;
      for (size_t i = offset; i < offset + count; ++i) {
        for (size_t axis = 0; axis < 3; ++axis) {
          // Half a step of the 16 bits of a position, below 100 here: 100 ln 100 / 65535.
          const double value = double(cloud.positions[i * 3 + axis]);
          EXPECT_GE(value, double(node["bound"]["min"][axis]) - 0.01);
          EXPECT_LE(value, double(node["bound"]["max"][axis]) + 0.01);
        }
      }
    }
    EXPECT_LE(together, 300u);
  });
  EXPECT_EQ(splats[0], 2000u);
  EXPECT_EQ(splats[1], 400u);
  EXPECT_GE(chunks, 8u);
}

TEST_F(SogLevels, IsTheSameEveryTimeAndSplitsLongChunks) {
  const SplatCloud cloud = named(500, 1, 6, 0);
  const SogLevelsOptions options = {.chunk_splats = 1000, .chunk_side = 20.0};
  write({&cloud}, nullptr, options);
  const std::string first = load(meta());
  size_t chunks = 0;
  visit(json()["tree"], [&chunks](const Json&) { ++chunks; });
  EXPECT_GT(chunks, 1u);
  std::filesystem::remove_all(path("0_0"));
  std::filesystem::remove(meta());
  write({&cloud}, nullptr, options);
  EXPECT_EQ(load(meta()), first);
}

TEST_F(SogLevels, TakesLevelsOfNoSplatsAndEqualPlaces) {
  SplatCloud same = named(1000, 0, 7, 0);
  for (float& x : same.positions) x = 1.0f;
  const SplatCloud none;
  write({&same, &none});
  EXPECT_EQ(readSogLevels(meta(), nullptr).size(), 1000u);
  EXPECT_EQ(json()["counts"], Json({1000, 0}));
  expectError(ErrorCode::kInvalidArgument, {"0 levels"}, [&] { write({}); });
}

TEST_F(SogLevels, ReadsOnlyTheChunksOfTheFinestLevel) {
  const SplatCloud cloud = named(900, 0, 8, 0);
  writeSog(cloud, path("all.sog"), {.sort = false}, nullptr);
  // One file for both levels: 100..299 and 500..599 are fine.
  store("lod-meta.json", R"({"lodLevels": 2, "filenames": ["all.sog"], "tree": {"children": [
      {"lods": {"0": {"file": 0, "offset": 500, "count": 100},
                "1": {"file": 0, "offset": 0, "count": 100}}},
      {"lods": {"0": {"file": 0, "offset": 100, "count": 200}}}]}})");
  const SplatCloud back = readSogLevels(meta(), nullptr);
  ASSERT_EQ(back.size(), 300u);
  for (size_t i = 0; i < 300; ++i) {
    EXPECT_EQ(back.sh[i * 3], cloud.sh[(i < 200 ? 100 + i : 300 + i) * 3]);
  }
}

TEST_F(SogLevels, SaysWhatIsWrong) {
  const SplatCloud cloud = named(900, 0, 9, 0);
  write({&cloud});
  const Json good = json();
  const auto with = [&](const char* pointer, const Json& value) {
    Json changed = good;
    changed[Json::json_pointer(pointer)] = value;
    return changed;
  };
  for (const char* name : {"../x/meta.json", "/etc/meta.json", "a\\b", "", "a/../../b"}) {
    refused(with("/filenames/0", name), {"lod-meta.json", "'filenames'", "'..'"});
  }
  refused(with("/environment", "../sky/meta.json"), {"'environment'", "'..'"});
  refused(with("/filenames/1", good["filenames"][0]), {"twice"});
  refused(with("/version", 2), {"'version' is 2", "1 is supported"}, ErrorCode::kUnsupported);
  refused(with("/counts/0", uint64_t{1} << 40), {"1099511627776", "900"});
  refused(with("/filenames", 5), {"'filenames'"});
  refused(with("/tree", 5), {"'tree'"});
  Json lone = {{"filenames", good["filenames"]},
               {"tree", {{"lods", {{"0", {{"file", 0}, {"offset", 0}, {"count", 5}}}}}}}};
  const auto chunk = [&](const char* key, const Json& value) {
    Json changed = lone;
    changed["tree"]["lods"]["0"][key] = value;
    return changed;
  };
  refused(chunk("file", 99), {"file 99", "'filenames' has"});
  refused(chunk("count", uint64_t{1} << 40), {"1099511627776", "the file holds"});
  refused(chunk("offset", 5000), {"from splat 5000", "the file holds"});
  refused(chunk("offset", -1), {"'offset'", "whole number"});
  Json twice = lone;
  twice["tree"] = {{"children", {lone["tree"], lone["tree"]}}};
  refused(twice, {"overlap at splat 0"});
  Json deep = lone["tree"];
  for (int i = 0; i < 300; ++i) deep = {{"children", {deep}}};
  refused({{"filenames", good["filenames"]}, {"tree", deep}}, {"nested 60", "at most 256"});
  refused({{"filenames", good["filenames"]}, {"tree", Json::object()}}, {"no splats"});
  const std::string text = good.dump();
  for (size_t length = 0; length < text.size(); length += 7) {
    store("lod-meta.json", text.substr(0, length));
    expectError(ErrorCode::kFormat, {"lod-meta.json", "JSON"},
                [&] { readSogLevels(meta(), nullptr); });
  }
  std::filesystem::remove(path(good["filenames"][0]));
  refused(good, {"0_0", "cannot be opened"}, ErrorCode::kIo);
}

TEST_F(SogLevels, KeepsTheOldSceneUntilTheNewOneIsWhole) {
  const SplatCloud first = named(900, 1, 10, 0);
  const SplatCloud second = named(700, 0, 11, 500);
  write({&first});
  store("0_0/notes.txt", "mine");
  Progress cancelled;
  cancelled.cancel();
  const size_t before = fileCount();
  expectError(ErrorCode::kCancelled, {}, [&] {
    writeSogLevels({&second}, nullptr, meta(), {.chunk_splats = 300, .chunk_side = 1e9},
                   &cancelled);
  });
  EXPECT_EQ(fileCount(), before);
  EXPECT_EQ(namesOf(readSogLevels(meta(), nullptr)), namesOf(first));
  write({&second});
  EXPECT_EQ(namesOf(readSogLevels(meta(), nullptr)), namesOf(second));
  // The old files are gone; what somebody put beside them is not.
  EXPECT_FALSE(std::filesystem::exists(path("0_0/meta.json")));
  EXPECT_TRUE(std::filesystem::exists(path("0_0/notes.txt")));
}

TEST_F(SogLevels, IsWrittenByTheNameOfTheFile) {
  const SplatCloud cloud = named(300, 1, 12, 0);
  writeSplatFile(cloud, meta(), {});
  EXPECT_EQ(namesOf(readSplatFile(meta())), namesOf(cloud));
  expectError(ErrorCode::kIo, {"nowhere"},
              [&] { writeSplatFile(cloud, path("nowhere/lod-meta.json"), {}); });
}

}  // namespace
}  // namespace stipple
