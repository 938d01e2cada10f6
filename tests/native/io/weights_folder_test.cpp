#include "io/assets/weights_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "io/bytes/sha256.h"
#include "pipeline_weights.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;
using testing::EndsWith;
using testing::HasSubstr;

/// The small random networks of a golden, in files as users have them.
class WeightsFolderFiles : public ScratchFolder {
 protected:
  void SetUp() override {
    ScratchFolder::SetUp();
    splitPipelineWeights(std::string(STIPPLE_TEST_DATA) + "/networks/deg_pipeline_a.safetensors",
                         folder_.string());
  }
};

TEST_F(WeightsFolderFiles, TellsFilesByTheirTensors) {
  fs::create_directories(folder_ / "deep" / "er");
  fs::rename(path("dino.safetensors"), folder_ / "deep" / "er" / "one.safetensors");
  fs::rename(path("flow.safetensors"), path("Zwei.SafeTensors"));
  const WeightsFolder found = findWeights(folder_.string());
  EXPECT_THAT(found.of(WeightsRole::kStructureEncoder).path, EndsWith("deep/er/one.safetensors"));
  EXPECT_THAT(found.of(WeightsRole::kColourEncoder).path, EndsWith("vae.safetensors"));
  EXPECT_THAT(found.of(WeightsRole::kFlow).path, EndsWith("Zwei.SafeTensors"));
  EXPECT_THAT(found.of(WeightsRole::kDecoder).path, EndsWith("decoder.safetensors"));
  EXPECT_TRUE(found.notes.empty());
  for (const PublishedWeights& role : publishedWeights()) {
    EXPECT_EQ(found.of(role.role).bytes, fs::file_size(found.of(role.role).path));
    EXPECT_EQ(stateOf(found.of(role.role), role), WeightsState::kOtherSize);
  }
}

TEST_F(WeightsFolderFiles, FollowsLinksToFiles) {
  const fs::path blobs = folder_ / "blobs", snapshot = folder_ / "snapshot";
  fs::create_directories(blobs);
  fs::create_directories(snapshot);
  fs::rename(path("vae.safetensors"), blobs / "d64f3a");
  fs::create_symlink(blobs / "d64f3a", snapshot / "vae.safetensors");
  const WeightsFolder found = findWeights(folder_.string());
  EXPECT_THAT(found.of(WeightsRole::kColourEncoder).path, EndsWith("snapshot/vae.safetensors"));
  EXPECT_EQ(found.of(WeightsRole::kColourEncoder).bytes, fs::file_size(blobs / "d64f3a"));
}

TEST_F(WeightsFolderFiles, SaysWhatIsMissingAndWhatToDo) {
  fs::remove(path("flow.safetensors"));
  const WeightsFolder found = findWeights(folder_.string());
  EXPECT_EQ(stateOf(found.of(WeightsRole::kFlow), publishedWeights()[2]), WeightsState::kMissing);
  expectError(ErrorCode::kInvalidArgument,
              {"triposplat_fp16.safetensors", "huggingface.co", folder_.c_str()},
              [&] { requireWeights(found, WeightsRole::kFlow); });
  EXPECT_EQ(&requireWeights(found, WeightsRole::kDecoder), &found.of(WeightsRole::kDecoder));
}

TEST_F(WeightsFolderFiles, TakesTheFirstOfSeveralAndSaysSo) {
  fs::copy_file(path("vae.safetensors"), path("another.safetensors"));
  const WeightsFolder found = findWeights(folder_.string());
  EXPECT_THAT(found.of(WeightsRole::kColourEncoder).path, EndsWith("another.safetensors"));
  ASSERT_EQ(found.notes.size(), 1u);
  EXPECT_THAT(found.notes[0], HasSubstr("2 files are a FLUX.2 image autoencoder"));
}

TEST_F(WeightsFolderFiles, PrefersThePublishedSize) {
  // A longer file is damaged for a reader of tensors only where tensors lie past its end, so that
  // the copy may have as many bytes as the published file, most of them a hole.
  fs::copy_file(path("vae.safetensors"), path("z.safetensors"));
  fs::resize_file(path("z.safetensors"), publishedWeights()[1].bytes);
  const WeightsFolder found = findWeights(folder_.string());
  EXPECT_THAT(found.of(WeightsRole::kColourEncoder).path, EndsWith("z.safetensors"));
  EXPECT_EQ(stateOf(found.of(WeightsRole::kColourEncoder), publishedWeights()[1]),
            WeightsState::kUnchecked);
}

TEST_F(WeightsFolderFiles, NotesADownloadThatBrokeOff) {
  fs::resize_file(path("flow.safetensors"), fs::file_size(path("flow.safetensors")) / 2);
  const WeightsFolder found = findWeights(folder_.string());
  EXPECT_TRUE(found.of(WeightsRole::kFlow).path.empty());
  ASSERT_EQ(found.notes.size(), 1u);
  EXPECT_THAT(found.notes[0], HasSubstr("flow.safetensors"));
}

TEST_F(WeightsFolderFiles, PassesOverOtherFiles) {
  store("readme.txt", "text");
  store("other.safetensors", std::string("\x02\0\0\0\0\0\0\0{}", 10));
  const WeightsFolder found = findWeights(folder_.string());
  EXPECT_TRUE(found.notes.empty());
  EXPECT_FALSE(found.of(WeightsRole::kFlow).path.empty());
}

TEST_F(WeightsFolderFiles, HashesWhatIsThere) {
  fs::remove(path("dino.safetensors"));
  WeightsFolder found = findWeights(folder_.string());
  Progress progress;
  hashWeights(found, &progress);
  EXPECT_EQ(progress.fraction(), 1.0);
  EXPECT_EQ(found.of(WeightsRole::kStructureEncoder).sha256, "");
  EXPECT_EQ(found.of(WeightsRole::kFlow).sha256, sha256OfFile(path("flow.safetensors")));
}

TEST_F(WeightsFolderFiles, RefusesAFolderThatIsNotThere) {
  expectError(ErrorCode::kIo, {"/nowhere"}, [&] { findWeights(path("nowhere")); });
}

TEST(PublishedWeightsTable, TellsStatesApart) {
  PublishedWeights published = publishedWeights()[3];
  WeightsFile file;
  EXPECT_EQ(stateOf(file, published), WeightsState::kMissing);
  file.path = "x";
  EXPECT_EQ(stateOf(file, published), WeightsState::kOtherSize);
  file.bytes = published.bytes;
  EXPECT_EQ(stateOf(file, published), WeightsState::kUnchecked);
  file.sha256 = published.sha256;
  EXPECT_EQ(stateOf(file, published), WeightsState::kPublished);
  file.sha256[0] = 'x';
  EXPECT_EQ(stateOf(file, published), WeightsState::kOtherContent);
}

TEST(PublishedWeightsTable, HasARowForEachRole) {
  for (size_t i = 0; i < kWeightsRoleCount; ++i) {
    EXPECT_EQ(static_cast<size_t>(publishedWeights()[i].role), i);
    EXPECT_EQ(std::string(publishedWeights()[i].sha256).size(), 64u);
  }
}

TEST(WeightsRoleOfNames, KnowsPrefixesOfDecoders) {
  const std::string decoders[] = {"models.decoder.l_embedder.mlp.0.weight",
                                  "decoder_gs.points_offset_perturbation"};
  EXPECT_EQ(weightsRole(decoders), WeightsRole::kDecoder);
  const std::string half[] = {"octree.l_embedder.mlp.0.weight"};
  EXPECT_EQ(weightsRole(half), std::nullopt);
}

}  // namespace
}  // namespace stipple
