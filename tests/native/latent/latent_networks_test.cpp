#include "decode/latent/latent_networks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "base/error.h"
#include "latent/tiny_latent.h"

namespace stipple {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kFile = STIPPLE_TEST_DATA "/networks/deg_decoder_a.safetensors";

/// The tiny file under other names.
WeightTable renamed(const std::string& octree, const std::string& gaussians) {
  const WeightTable file = tinyFile(kFile);
  std::map<std::string, WeightTensor> tensors;
  for (const auto& [name, tensor] : tensorsOf(file)) {
    const bool is_octree = name.starts_with("octree.");
    tensors[is_octree ? octree + name.substr(7) : gaussians + name.substr(3)] = tensor;
  }
  return WeightTable("renamed.safetensors", tensors, std::make_shared<WeightTable>(file));
}

/// What is said of the tiny file after a change to its tensors.
template <typename Change>
std::string refusal(Change change) {
  const WeightTable file = tinyFile(kFile);
  std::map<std::string, WeightTensor> tensors = tensorsOf(file);
  change(tensors);
  try {
    readLatentNetworks(WeightTable("lying.safetensors", tensors, nullptr));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kFormat);
    return error.what();
  }
  return "not refused";
}

TEST(LatentNetworks, TakesSizesFromTheTensors) {
  const LatentNetworks networks = readLatentNetworks(tinyFile(kFile));
  EXPECT_EQ(networks.octree->latentWidth(), 16u);
  EXPECT_EQ(networks.gaussians->latentWidth(), 16u);
  EXPECT_EQ(networks.gaussians->gaussians(), 8u);
}

TEST(LatentNetworks, FindsThemUnderTheNamesOfTraining) {
  for (const auto& [octree, gaussians] :
       {std::pair("octree.", "gs."), std::pair("decoder.", "decoder_gs."),
        std::pair("models.decoder.", "decoder_gs."),
        std::pair("models.decoder.", "models.decoder_gs.")}) {
    EXPECT_EQ(readLatentNetworks(renamed(octree, gaussians)).gaussians->gaussians(), 8u);
  }
}

TEST(LatentNetworks, NamesATensorThatIsMissing) {
  EXPECT_THAT(refusal([](auto& tensors) { tensors.erase("gs.blocks.1.norm2.bias"); }),
              AllOf(HasSubstr("lying.safetensors"), HasSubstr("gs.blocks.1.norm2.bias")));
  EXPECT_THAT(refusal([](auto& tensors) { tensors.erase("octree.out_proj.weight"); }),
              AllOf(HasSubstr("lying.safetensors"), HasSubstr("octree.out_proj.weight")));
}

TEST(LatentNetworks, NamesATensorOfAnotherShape) {
  EXPECT_THAT(
      refusal([](auto& tensors) {
        tensors.at("octree.blocks.1.cross_attn.to_q.weight").shape = {48, 192};
      }),
      AllOf(HasSubstr("lying.safetensors"), HasSubstr("octree.blocks.1.cross_attn.to_q.weight"),
            HasSubstr("48"), HasSubstr("96")));
  EXPECT_THAT(refusal([](auto& tensors) {
                tensors.at("gs.points_offset_perturbation").shape = {2, 3};
              }),
              AllOf(HasSubstr("points_offset_perturbation"), HasSubstr("2 Gaussians"),
                    HasSubstr("4 to 32")));
  EXPECT_THAT(refusal([](auto& tensors) {
                tensors.at("gs.blocks.0.cross_attn.q_rms_norm.gamma").shape = {1, 4};
              }),
              AllOf(HasSubstr("1 heads of 4"), HasSubstr("at least 12")));
  // Blocks that do not read the same latent.
  EXPECT_THAT(
      refusal([](auto& tensors) {
        tensors.at("gs.blocks.1.cross_attn.to_kv.weight").shape = {192, 8};
      }),
      AllOf(HasSubstr("gs.blocks.1.cross_attn.to_kv.weight"), HasSubstr("8"), HasSubstr("16")));
}

TEST(LatentNetworks, NamesAUnitOfLengthsThatIsNone) {
  for (const float unit : {0.0f, -0.05f, 2.0f, std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_THAT(refusal([&](auto& tensors) {
                  WeightTensor tensor = tensors.at("gs.base_offset_scale");
                  tensor.type = WeightType::kFloat32;
                  tensor.shape = {1};
                  tensor.bytes = reinterpret_cast<const uint8_t*>(&unit);
                  tensors["gs.spacing_unit"] = tensor;
                }),
                AllOf(HasSubstr("lying.safetensors"), HasSubstr("spacing_unit")));
  }
}

TEST(LatentNetworks, NamesATensorThatIsOfNoFloatingPointType) {
  EXPECT_THAT(refusal([](auto& tensors) {
                auto& tensor = tensors.at("octree.in_proj.weight");
                tensor.type = WeightType::kOther;
                tensor.type_name = "I64";
              }),
              AllOf(HasSubstr("octree.in_proj.weight"), HasSubstr("I64")));
}

TEST(LatentNetworks, NamesATensorThatIsTooMany) {
  EXPECT_THAT(refusal([](auto& tensors) {
                tensors["gs.blocks.7.norm2.bias"] = tensors.at("gs.blocks.0.norm2.bias");
              }),
              AllOf(HasSubstr("lying.safetensors"), HasSubstr("1 tensor that"),
                    HasSubstr("gs.blocks.7.norm2.bias")));
}

TEST(LatentNetworks, SaysWhatIsMissingInAnotherNetworksFile) {
  try {
    readLatentNetworks(openWeightFile(STIPPLE_TEST_DATA "/networks/deg_flow_a.safetensors"));
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kFormat);
    EXPECT_THAT(error.what(), AllOf(HasSubstr("deg_flow_a.safetensors"),
                                    HasSubstr("octree.l_embedder.mlp.0.weight")));
  }
}

TEST(LatentNetworks, SaysThatWeightsAreNotFinite) {
  const WeightTable file = tinyFile(kFile);
  std::map<std::string, WeightTensor> tensors = tensorsOf(file);
  WeightTensor& weight = tensors.at("gs.out_proj.weight");
  const std::vector<uint8_t> ones(weight.count() * 4, 0xff);  // a NaN in float32
  weight.bytes = ones.data();
  try {
    const LatentNetworks networks =
        readLatentNetworks(WeightTable("lying.safetensors", tensors, nullptr));
    const std::array<float, 3> point = {0.5f, 0.5f, 0.5f};
    const LatentKeys keys = networks.gaussians->keysOf({}, *tinyLatent(kFile));
    networks.gaussians->features({}, keys, 1, point.data());
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kFormat);
    EXPECT_THAT(error.what(), HasSubstr("lying.safetensors"));
  }
}

}  // namespace
}  // namespace stipple
