#include "io/assets/surface_asset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <string>

#include "base/error.h"
#include "io/bytes/safetensors.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class SurfaceAssetFile : public ScratchFolder {};
class SafeTensors : public ScratchFolder {
 protected:
  /// A file of a JSON header and data, with the true header length.
  std::string file(const std::string& header, const std::string& data) {
    const uint64_t length = header.size();
    std::string bytes(8, '\0');
    std::memcpy(bytes.data(), &length, 8);
    return store("a.safetensors", bytes + header + data);
  }
};

SurfaceAsset randomAsset(size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  SurfaceAsset asset;
  asset.root_origin = {0.1, -1.0 / 3.0, 1e5};
  asset.root_side = 2.0 / 7.0;
  asset.cells = {{0}, {1, 3, 7}, {uint64_t{1} << 40}};
  for (const auto& cells : asset.cells) {
    std::vector<float> row(cells.size() * 8);
    for (float& value : row) value = -std::abs(normal(random));
    row.back() = -HUGE_VALF;
    asset.log_probabilities.push_back(row);
  }
  const auto fill = [&](std::vector<float>& values, size_t width) {
    values.resize(count * width);
    for (float& value : values) value = normal(random);
  };
  fill(asset.surface.positions, 3);
  fill(asset.surface.normals, 3);
  for (size_t i = 0; i < count; ++i) {
    float* n = &asset.surface.normals[i * 3];
    const float length = std::hypot(n[0], n[1], n[2]);
    for (size_t axis = 0; axis < 3; ++axis) n[axis] /= length;
  }
  fill(asset.surface.colours, 3);
  fill(asset.surface.opacities, 1);
  fill(asset.surface.areas, 1);
  fill(asset.surface.weights, 1);
  for (float& area : asset.surface.areas) area = std::abs(area);
  for (float& weight : asset.surface.weights) weight = std::abs(weight);
  asset.settings_json = "{\"detail\":0.5,\"name\":\"\\u00e4\"}";
  return asset;
}

TEST_F(SurfaceAssetFile, KeepsHarmonicsOfAnyDegreeAndNoOtherNumberOfThem) {
  for (int degree = 1; degree <= kMaxViewDegree; ++degree) {
    SurfaceAsset asset = randomAsset(101, 1);
    asset.surface.harmonic_degree = degree;
    asset.surface.harmonics.resize(101 * asset.surface.harmonicStride());
    for (size_t i = 0; i < asset.surface.harmonics.size(); ++i) {
      asset.surface.harmonics[i] = static_cast<float>(i) / 7.0f;
    }
    writeSurfaceAsset(asset, path("h.stipple.safetensors"));
    const SurfaceAsset seen = readSurfaceAsset(path("h.stipple.safetensors"));
    EXPECT_EQ(seen.surface.harmonic_degree, degree);
    EXPECT_EQ(seen.surface.harmonics, asset.surface.harmonics);
    asset.surface.harmonics.pop_back();
    EXPECT_THROW(writeSurfaceAsset(asset, path("h.stipple.safetensors")), Error);
  }
  const SurfaceAsset asset = randomAsset(8, 1);
  writeSurfaceAsset(asset, path("h.stipple.safetensors"));
  SafeTensorsWriter odd;
  const SafeTensorsReader whole(path("h.stipple.safetensors"));
  for (const auto& [key, value] : whole.metadata()) odd.setMetadata(key, value);
  const auto tensors = whole.readOthers();
  for (const auto& [name, tensor] : tensors) odd.carry(name, tensor);
  const std::vector<float> ten(80, 0.5f);
  odd.add("surface.harmonics", ten, 10);
  odd.write(path("odd.stipple.safetensors"));
  try {
    readSurfaceAsset(path("odd.stipple.safetensors"));
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("has 10 numbers a sample; 9, 24 or 45"),
              std::string::npos)
        << error.what();
  }
}

TEST_F(SurfaceAssetFile, GivesEverythingBackBitForBit) {
  const SurfaceAsset asset = randomAsset(1001, 1);
  writeSurfaceAsset(asset, path("a.stipple.safetensors"));
  const SurfaceAsset seen = readSurfaceAsset(path("a.stipple.safetensors"));
  EXPECT_EQ(seen.root_origin, asset.root_origin);
  EXPECT_EQ(seen.root_side, asset.root_side);
  EXPECT_EQ(seen.cells, asset.cells);
  EXPECT_EQ(seen.log_probabilities, asset.log_probabilities);
  EXPECT_EQ(seen.surface.positions, asset.surface.positions);
  EXPECT_EQ(seen.surface.normals, asset.surface.normals);
  EXPECT_EQ(seen.surface.colours, asset.surface.colours);
  EXPECT_EQ(seen.surface.opacities, asset.surface.opacities);
  EXPECT_EQ(seen.surface.areas, asset.surface.areas);
  EXPECT_EQ(seen.surface.weights, asset.surface.weights);
  EXPECT_EQ(seen.settings_json, asset.settings_json);
  writeSurfaceAsset(seen, path("b.stipple.safetensors"));
  EXPECT_EQ(load(path("a.stipple.safetensors")), load(path("b.stipple.safetensors")));
}

TEST_F(SurfaceAssetFile, KeepsAnEmptyAsset) {
  const SurfaceAsset seen = [&] {
    writeSurfaceAsset(SurfaceAsset(), path("a"));
    return readSurfaceAsset(path("a"));
  }();
  EXPECT_TRUE(seen.cells.empty());
  EXPECT_EQ(seen.surface.size(), 0u);
}

TEST_F(SurfaceAssetFile, PassesOverUnknownTensorsAndMinorVersions) {
  const SurfaceAsset asset = randomAsset(3, 2);
  writeSurfaceAsset(asset, path("a"));
  std::string bytes = load(path("a"));
  bytes.replace(bytes.find("\"1.0\""), 5, "\"1.9\"");
  // A tensor of a type from the future in front of the others, with a byte behind them; eight bytes
  // hold the header's length.
  uint64_t length = 0;
  std::memcpy(&length, bytes.data(), 8);
  const size_t data = bytes.size() - 8 - static_cast<size_t>(length);
  const std::string extra = "\"new\":{\"dtype\":\"F4\",\"shape\":[9],\"data_offsets\":[" +
                            std::to_string(data) + "," + std::to_string(data + 1) + "]},";
  bytes.insert(9, extra).push_back('\1');
  length += extra.size();
  std::memcpy(bytes.data(), &length, 8);
  EXPECT_EQ(readSurfaceAsset(store("b", bytes)).cells, asset.cells);
}

TEST_F(SurfaceAssetFile, RefusesNewerMajorVersionsAndOtherKinds) {
  writeSurfaceAsset(randomAsset(3, 2), path("a"));
  const std::string bytes = load(path("a"));
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = bytes;
    EXPECT_EQ(from.size(), to.size());
    changed.replace(changed.find(from), from.size(), to);
    return store("b", changed);
  };
  expectError(ErrorCode::kUnsupported, {"version 2", "version 1"},
              [&] { readSurfaceAsset(with("\"1.0\"", "\"2.0\"")); });
  expectError(ErrorCode::kUnsupported, {"'sunface'"},
              [&] { readSurfaceAsset(with("\"surface\"", "\"sunface\"")); });
  expectError(ErrorCode::kFormat, {"root_cube"},
              [&] { readSurfaceAsset(with("\"root_cube\":\"[", "\"root_cube\":\"{")); });
  expectError(ErrorCode::kFormat, {"'octree.log_p.1'"},
              [&] { readSurfaceAsset(with("octree.log_p.1", "octree.log_q.1")); });
  expectError(ErrorCode::kFormat, {"'x.0'", "stipple_version"},
              [&] { readSurfaceAsset(with("\"1.0\"", "\"x.0\"")); });
}

TEST_F(SurfaceAssetFile, RefusesPartsThatDoNotFitTogether) {
  const auto refuse = [&](std::initializer_list<const char*> texts, const auto& spoil) {
    SurfaceAsset asset = randomAsset(5, 3);
    spoil(asset);
    expectError(ErrorCode::kInvalidArgument, texts, [&] { writeSurfaceAsset(asset, path("a")); });
  };
  refuse({"levels"}, [](SurfaceAsset& a) { a.cells.pop_back(); });
  refuse({"octree.log_p.1", "24"}, [](SurfaceAsset& a) { a.log_probabilities[1].pop_back(); });
  refuse({"octree.log_p.0", "nan"}, [](SurfaceAsset& a) { a.log_probabilities[0][3] = NAN; });
  refuse({"surface.areas", "4"}, [](SurfaceAsset& a) { a.surface.areas.pop_back(); });
  refuse({"surface.normals", "row 2"}, [](SurfaceAsset& a) { a.surface.normals[6] = HUGE_VALF; });
  refuse({"surface.areas", "-2", "row 3"}, [](SurfaceAsset& a) { a.surface.areas[3] = -2; });
  refuse({"surface.weights", "row 0"}, [](SurfaceAsset& a) { a.surface.weights[0] = -1; });
  // Tangents of such normals would be infinite.
  refuse({"surface.normals", "row 1"}, [](SurfaceAsset& a) { a.surface.normals[4] = 1e37f; });
  EXPECT_EQ(fileCount(), 0u);
}

TEST_F(SurfaceAssetFile, NormalsMayBeShortButNotLong) {
  SurfaceAsset asset = randomAsset(2, 6);
  asset.surface.normals = {0, 0, 0, 0, 1.0005f, 0};
  writeSurfaceAsset(asset, path("a"));
  EXPECT_EQ(readSurfaceAsset(path("a")).surface.normals, asset.surface.normals);
  std::string bytes = load(path("a"));
  const float good = 1.0005f, bad = 1.5f;
  const size_t place = bytes.find(std::string(reinterpret_cast<const char*>(&good), 4));
  ASSERT_NE(place, std::string::npos);
  std::memcpy(&bytes[place], &bad, 4);
  expectError(ErrorCode::kFormat, {"surface.normals", "1.5", "row 1"},
              [&] { readSurfaceAsset(store("b", bytes)); });
}

TEST_F(SurfaceAssetFile, SurvivesTruncationAndDamage) {
  writeSurfaceAsset(randomAsset(2, 4), path("a"));
  const std::string bytes = load(path("a"));
  for (size_t length = 0; length < bytes.size(); ++length) {
    try {
      readSurfaceAsset(store("b", bytes.substr(0, length)));
      ADD_FAILURE() << length << " bytes are accepted";
    } catch (const Error&) {
    }
  }
  std::mt19937 random(5);
  for (int trial = 0; trial < 2000; ++trial) {
    std::string damaged = bytes;
    damaged[random() % damaged.size()] = static_cast<char>(random());
    try {
      readSurfaceAsset(store("b", damaged));
    } catch (const Error&) {
    }
  }
}

TEST_F(SafeTensors, ReadsAHandWrittenFile) {
  const SafeTensorsReader reader(
      file("{\"b\":{\"dtype\":\"U64\",\"shape\":[1],\"data_offsets\":[4,12]},"
           "\"a\":{\"dtype\":\"F32\",\"shape\":[1,1],\"data_offsets\":[0,4]},"
           "\"__metadata__\":{\"k\":\"v\"}}",
           std::string("\x00\x00\x80\x3f\x02\x00\x00\x00\x00\x00\x00\x00", 12)));
  EXPECT_EQ(reader.metadata().at("k"), "v");
  EXPECT_EQ(reader.readFloats("a", 1), std::vector<float>{1.0f});
  EXPECT_EQ(reader.readUint64s("b", 1), std::vector<uint64_t>{2});
  expectError(ErrorCode::kFormat, {"'a'", "F32 [1, 1]", "U64"},
              [&] { reader.readUint64s("a", 1); });
  expectError(ErrorCode::kFormat, {"'a'", "[n, 3]"}, [&] { reader.readFloats("a", 3); });
  expectError(ErrorCode::kFormat, {"no tensor 'c'"}, [&] { reader.readFloats("c", 1); });
}

TEST_F(SafeTensors, RefusesLyingHeaders) {
  const auto refuse = [&](const std::string& entry, std::initializer_list<const char*> texts) {
    expectError(ErrorCode::kFormat, texts, [&] {
      const SafeTensorsReader reader(file("{\"a\":" + entry + "}", std::string(16, 'x')));
    });
  };
  refuse("{\"dtype\":\"F32\",\"shape\":[5],\"data_offsets\":[0,20]}", {"'a'", "20", "16 bytes"});
  refuse("{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[8,4]}", {"8 to 4"});
  refuse("{\"dtype\":\"F32\",\"shape\":[3],\"data_offsets\":[0,16]}", {"16 bytes", "[3] of F32"});
  refuse("{\"dtype\":\"F32\",\"shape\":[4294967296,4294967296],\"data_offsets\":[0,0]}",
         {"[4294967296"});
  refuse("{\"dtype\":\"F32\",\"shape\":[-1],\"data_offsets\":[0,4]}", {"shape"});
  refuse("{\"dtype\":\"F32\",\"shape\":[1]}", {"data_offsets"});
  refuse("7", {"dtype"});
  expectError(ErrorCode::kFormat, {"at least 8"},
              [&] { const SafeTensorsReader reader(store("a", "1234567")); });
  expectError(ErrorCode::kFormat, {"claims a header of"},
              [&] { const SafeTensorsReader reader(store("a", std::string(40, '~'))); });
  expectError(ErrorCode::kIo, {"No such file"},
              [&] { const SafeTensorsReader reader(path("missing")); });
}

}  // namespace
}  // namespace stipple
