// Sizes and SHA-256 of the published files agree in at least four unrelated ports of the networks;
// sizes also follow from the numbers of parameters. No file was ever here.
#include "io/assets/weights_folder.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/platform/files.h"
#include "io/assets/weight_file.h"
#include "io/bytes/input_file.h"
#include "io/bytes/safetensors.h"
#include "io/bytes/sha256.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

// A folder of weights has a few dozen entries; a home folder that was chosen by mistake has more.
constexpr size_t kMaxEntries = 20000;
constexpr int kMaxDepth = 8;

/// A name that only files of the role have, after any of the prefixes that files of other exporters
/// put before all names; all signs of a role are needed.
struct Sign {
  WeightsRole role;
  std::array<const char*, 2> names;
};
constexpr Sign kSigns[] = {
    {WeightsRole::kStructureEncoder,
     {"embeddings.register_tokens", "embeddings.patch_embeddings.weight"}},
    {WeightsRole::kColourEncoder, {"encoder.conv_in.weight", "bn.running_mean"}},
    {WeightsRole::kFlow, {"cond_embedder2.weight", "cam_out_layer.weight"}},
};
/// The decoder's two networks, by what their tensors' names begin with.
constexpr const char* kOctreePrefixes[] = {"octree.", "decoder.", "models.decoder."};
constexpr const char* kGaussianPrefixes[] = {"gs.", "decoder_gs."};

bool has(std::span<const std::string> names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

template <size_t N>
bool hasUnderAny(std::span<const std::string> names, const char* const (&prefixes)[N],
                 const char* name) {
  for (const char* prefix : prefixes) {
    if (has(names, std::string(prefix) + name)) return true;
  }
  return false;
}

struct Candidate {
  WeightsRole role;
  WeightsFile file;
};

WeightsFile statusOf(const fs::path& path) {
  platform::PathStatus status;
  if (!platform::statusOf(path.string(), status)) return {};
  WeightsFile file;
  file.path = path.string();
  file.bytes = status.bytes;
  file.modified = status.modified;
  return file;
}

/// Whether a file is a better one for its role than what was found before it.
bool isBetter(const WeightsFile& file, const WeightsFile& before, const PublishedWeights& role) {
  return before.path.empty() || (file.bytes == role.bytes && before.bytes != role.bytes);
}

}  // namespace

std::span<const PublishedWeights, kWeightsRoleCount> publishedWeights() {
  static const std::array<PublishedWeights, kWeightsRoleCount> published = {{
      {WeightsRole::kStructureEncoder, "DINOv3 image encoder",
       "clip_vision/dino_v3_vit_h.safetensors", 1681247696,
       "a29ef35101a16966972a0d50732a6f3a608ff7cfffb2afa9bbe9007cb842cc53",
       "DINOv3 License of Meta: terms of its own, which Meta asks to accept before a download."},
      {WeightsRole::kColourEncoder, "FLUX.2 image autoencoder", "vae/flux2-vae.safetensors",
       336213556, "d64f3a68e1cc4f9f4e29b6e0da38a0204fe9a49f2d4053f0ec1fa1ca02f9c4b5",
       "Of Black Forest Labs: reported as Apache 2.0, while FLUX.2-dev around it is not for "
       "commercial use. Read the terms that come with the file."},
      {WeightsRole::kFlow, "TripoSplat flow network",
       "diffusion_models/triposplat_fp16.safetensors", 741106994,
       "c870b97ac1d6bc9177608a5ec625e19ef9f3c5019aa68f64b0fb7803abcd6d20",
       "MIT, as the published model says."},
      {WeightsRole::kDecoder, "TripoSplat decoder", "vae/triposplat_vae_decoder_fp16.safetensors",
       576148442, "ed0d0c3d43b599e326845d0ec70f3cf77be9a55e2d97627ac3b34d2830763cc8",
       "MIT, as the published model says."},
  }};
  return published;
}

const char* publishedWeightsSource() {
  return "The files are those of the model VAST-AI/TripoSplat at huggingface.co (or "
         "VAST-AI-Research/TripoSplat at modelscope.cn). Download them there, after reading their "
         "licences; their names and folders do not matter.";
}

WeightsState stateOf(const WeightsFile& file, const PublishedWeights& published) {
  if (file.path.empty()) return WeightsState::kMissing;
  if (file.is_trained) return WeightsState::kTrained;
  if (file.bytes != published.bytes) return WeightsState::kOtherSize;
  if (file.sha256.empty()) return WeightsState::kUnchecked;
  return file.sha256 == published.sha256 ? WeightsState::kPublished : WeightsState::kOtherContent;
}

WeightsState stateOf(const WeightsFolder& folder, WeightsRole role) {
  const bool is_encoder =
      role == WeightsRole::kStructureEncoder || role == WeightsRole::kColourEncoder;
  if (is_encoder && folder.of(WeightsRole::kFlow).is_trained) return WeightsState::kNotNeeded;
  return stateOf(folder.of(role), publishedWeights()[static_cast<size_t>(role)]);
}

std::optional<WeightsRole> weightsRole(std::span<const std::string> tensor_names) {
  for (const Sign& sign : kSigns) {
    if (std::all_of(sign.names.begin(), sign.names.end(),
                    [&](const char* name) { return has(tensor_names, name); })) {
      return sign.role;
    }
  }
  if (hasUnderAny(tensor_names, kOctreePrefixes, "l_embedder.mlp.0.weight") &&
      hasUnderAny(tensor_names, kGaussianPrefixes, "points_offset_perturbation")) {
    return WeightsRole::kDecoder;
  }
  return std::nullopt;
}

std::vector<std::string> weightFilesBelow(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;
  size_t entries = 0;
  fs::recursive_directory_iterator at(folder, fs::directory_options::skip_permission_denied, error);
  for (; !error && at != fs::recursive_directory_iterator(); at.increment(error)) {
    if (++entries > kMaxEntries) {
      fail(ErrorCode::kInvalidArgument,
           "'" + folder + "' holds more than " + std::to_string(kMaxEntries) +
               " files and folders; choose the folder that the files of weights are in");
    }
    if (at.depth() >= kMaxDepth) at.disable_recursion_pending();
    std::error_code ignored;
    if (lowerExtension(at->path().string()) == ".safetensors" && at->is_regular_file(ignored)) {
      paths.push_back(at->path().string());
    }
  }
  if (error) fail(ErrorCode::kIo, "'" + folder + "' cannot be read: " + error.message());
  std::sort(paths.begin(), paths.end());
  return paths;
}

WeightsFolder findWeights(const std::string& folder) {
  WeightsFolder found;
  found.path = folder;
  std::array<size_t, kWeightsRoleCount> counts = {};
  for (const std::string& path : weightFilesBelow(folder)) {
    std::vector<std::string> names;
    bool is_trained = false;
    try {
      const SafeTensorsReader reader(path);
      is_trained = reader.metadata().count(kTrainedKey) != 0;
      for (const auto& [name, tensor] : reader.tensors()) names.push_back(name);
    } catch (const Error& error) {
      found.notes.push_back(std::string(error.what()) + ".");
      continue;
    }
    const std::optional<WeightsRole> role = weightsRole(names);
    if (!role) continue;
    const auto index = static_cast<size_t>(*role);
    ++counts[index];
    WeightsFile file = statusOf(path);
    file.is_trained = is_trained;
    if (isBetter(file, found.files[index], publishedWeights()[index])) {
      found.files[index] = std::move(file);
    }
  }
  for (size_t i = 0; i < kWeightsRoleCount; ++i) {
    if (counts[i] < 2) continue;
    found.notes.push_back(std::to_string(counts[i]) + " files are a " +
                          publishedWeights()[i].label + "; " + found.files[i].path + " is used.");
  }
  return found;
}

const WeightsFile& requireWeights(const WeightsFolder& folder, WeightsRole role) {
  const WeightsFile& file = folder.of(role);
  const PublishedWeights& published = publishedWeights()[static_cast<size_t>(role)];
  if (file.path.empty()) {
    fail(ErrorCode::kInvalidArgument, "'" + folder.path + "' has no file with the weights of the " +
                                          published.label + " (published as " + published.path +
                                          "). " + publishedWeightsSource());
  }
  return file;
}

void hashWeights(WeightsFolder& folder, Progress* progress) {
  uint64_t total = 0;
  for (const WeightsFile& file : folder.files) total += file.bytes;
  uint64_t done = 0;
  for (size_t i = 0; i < kWeightsRoleCount; ++i) {
    WeightsFile& file = folder.files[i];
    if (file.path.empty()) continue;
    const auto share = [&](uint64_t bytes) {
      return static_cast<double>(bytes) / static_cast<double>(std::max<uint64_t>(total, 1));
    };
    if (progress) progress->enterPart(share(done), share(done + file.bytes));
    const std::string stage = std::string("Checking the ") + publishedWeights()[i].label;
    file.sha256 = sha256OfFile(file.path, progress, stage.c_str());
    done += file.bytes;
  }
}

}  // namespace stipple
