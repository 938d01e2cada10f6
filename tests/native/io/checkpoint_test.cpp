#include "io/assets/checkpoint.h"

#include <gtest/gtest.h>
#include <sys/mount.h>

#include "io/assets/asset_header.h"
#include "io/bytes/safetensors.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class CheckpointFile : public ScratchFolder {
 protected:
  std::string name() const { return path("a.checkpoint.stipple.safetensors"); }
};

Checkpoint smallCheckpoint() {
  Checkpoint checkpoint;
  checkpoint.settings_json = "{\"iterations\":40}";
  checkpoint.tensors["raw.positions"] = {{2, 3}, std::vector<float>{1, 2, 3, 4, 5, 6.5f}};
  checkpoint.tensors["iteration"] = {{1}, std::vector<uint64_t>{uint64_t{1} << 40}};
  checkpoint.tensors["history.measures"] = {{1, 2}, std::vector<double>{0.1, -1e300}};
  checkpoint.tensors["strategy.seen"] = {{3}, std::vector<uint8_t>{1, 0, 255}};
  checkpoint.tensors["strategy.counts"] = {{2}, std::vector<uint32_t>{7, 0xffffffffu}};
  checkpoint.tensors["scalar"] = {{}, std::vector<float>{2.5f}};
  checkpoint.tensors["empty"] = {{0, 3}, std::vector<float>{}};
  return checkpoint;
}

void expectSame(const Checkpoint& a, const Checkpoint& b) {
  EXPECT_EQ(a.settings_json, b.settings_json);
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) {
    EXPECT_EQ(tensor.shape, b.tensors.at(name).shape) << name;
    EXPECT_EQ(tensor.values, b.tensors.at(name).values) << name;
  }
}

TEST_F(CheckpointFile, GivesEveryTypeBackBitForBit) {
  writeCheckpoint(smallCheckpoint(), name());
  EXPECT_EQ(readAssetKind(name()), kAssetCheckpoint);
  expectSame(readCheckpoint(name()), smallCheckpoint());
}

TEST_F(CheckpointFile, EveryTruncatedPrefixIsRefused) {
  writeCheckpoint(smallCheckpoint(), name());
  const std::string bytes = load(name());
  for (size_t length = 0; length < bytes.size(); ++length) {
    EXPECT_THROW(readCheckpoint(store("cut.safetensors", bytes.substr(0, length))), Error)
        << length;
  }
}

TEST_F(CheckpointFile, AChangeOfAnyByteIsRefusedByName) {
  writeCheckpoint(smallCheckpoint(), name());
  const std::string bytes = load(name());
  for (size_t at = 0; at < bytes.size(); ++at) {
    for (const int flipped : {0x01, 0x20, 0x80, 0xff}) {
      std::string damaged = bytes;
      damaged[at] = static_cast<char>(damaged[at] ^ flipped);
      try {
        readCheckpoint(store("damaged.safetensors", damaged));
        ADD_FAILURE() << "byte " << at << " was accepted with " << flipped;
      } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("damaged.safetensors"), std::string::npos)
            << error.what();
      }
    }
  }
  // Of what no reader would doubt: the last number of the last tensor.
  std::string damaged = bytes;
  damaged.back() ^= 1;
  expectError(ErrorCode::kFormat, {"is damaged", "checksum"},
              [&] { readCheckpoint(store("damaged.safetensors", damaged)); });
}

TEST_F(CheckpointFile, FindsItsChecksumWhateverTheSettingsSay) {
  Checkpoint checkpoint = smallCheckpoint();
  checkpoint.settings_json = "{\"checksum\":\"0123456789abcdef\"}";
  writeCheckpoint(checkpoint, name());
  expectSame(readCheckpoint(name()), checkpoint);
}

TEST_F(CheckpointFile, ReadsCheckpointsOfBeforeChecksums) {
  SafeTensorsWriter file;
  setAssetKind(file, kAssetCheckpoint);
  const Checkpoint checkpoint = smallCheckpoint();
  file.setMetadata("settings", checkpoint.settings_json);
  for (const auto& [tensor_name, tensor] : checkpoint.tensors) file.add(tensor_name, tensor);
  file.write(name());
  EXPECT_NE(load(name()).find("\"stipple_version\":\"1.0\""), std::string::npos);
  expectSame(readCheckpoint(name()), checkpoint);
}

TEST_F(CheckpointFile, DoesNotReplaceAModel) {
  SafeTensorsWriter model;
  setAssetKind(model, kAssetSurface);
  model.write(name());
  const std::string before = load(name());
  expectError(ErrorCode::kInvalidArgument, {name().c_str(), "another kind", "a checkpoint"},
              [&] { writeCheckpoint(smallCheckpoint(), name()); });
  EXPECT_EQ(load(name()), before);
  writeCheckpoint(smallCheckpoint(), path("new.safetensors"));
  EXPECT_NO_THROW(writeCheckpoint(smallCheckpoint(), path("new.safetensors")));
}

TEST_F(CheckpointFile, RefusesOtherVersionsKindsAndTypes) {
  const auto stored = [&](const char* version, const char* kind) {
    SafeTensorsWriter file;
    file.setMetadata("stipple_version", version);
    file.setMetadata("kind", kind);
    file.setMetadata("settings", "{}");
    file.write(path("other.safetensors"));
    return path("other.safetensors");
  };
  expectError(ErrorCode::kUnsupported, {"version 2"},
              [&] { readCheckpoint(stored("2.0", "checkpoint")); });
  expectError(ErrorCode::kUnsupported, {"'surface'", "'checkpoint' is needed"},
              [&] { readCheckpoint(stored("1.0", "surface")); });
  SafeTensorsWriter file;
  setAssetKind(file, kAssetCheckpoint);
  file.setMetadata("settings", "{}");
  const CarriedTensor half{"F16", {1}, {0, 0}};
  file.carry("raw.half", half);
  file.write(path("half.safetensors"));
  expectError(ErrorCode::kFormat, {"raw.half", "F16"},
              [&] { readCheckpoint(path("half.safetensors")); });
}

TEST_F(CheckpointFile, RefusesATensorWhoseShapeIsNotItsValues) {
  Checkpoint wrong = smallCheckpoint();
  wrong.tensors["raw.positions"].shape = {3, 3};
  expectError(ErrorCode::kInvalidArgument, {"raw.positions", "[3, 3]"},
              [&] { writeCheckpoint(wrong, name()); });
  EXPECT_EQ(fileCount(), 0u);
}

TEST_F(CheckpointFile, AFullDiskLeavesTheOldOne) {
  // A file system of 64 KiB; only the superuser may mount one.
  if (::mount("tmpfs", folder_.c_str(), "tmpfs", 0, "size=64k") != 0) {
    GTEST_SKIP() << "mounting a small file system is not allowed here";
  }
  writeCheckpoint(smallCheckpoint(), name());
  Checkpoint large = smallCheckpoint();
  large.tensors["raw.sh"] = {{1 << 18}, std::vector<float>(1 << 18, 1.0f)};
  expectError(ErrorCode::kIo, {"a.checkpoint", "No space left on device"},
              [&] { writeCheckpoint(large, name()); });
  expectSame(readCheckpoint(name()), smallCheckpoint());
  EXPECT_EQ(fileCount(), 1u);
  ASSERT_EQ(::umount(folder_.c_str()), 0);
}

}  // namespace
}  // namespace stipple
