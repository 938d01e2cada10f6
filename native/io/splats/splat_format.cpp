#include "io/splats/splat_format.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "io/bytes/input_file.h"
#include "io/splats/gltf_splat_names.h"
#include "io/splats/gltf_splats.h"
#include "io/splats/ksplat_file.h"
#include "io/splats/ply/ply_file.h"
#include "io/splats/sog_file.h"
#include "io/splats/sog_levels.h"
#include "io/splats/splat32_file.h"
#include "io/splats/spz_file.h"
#include "io/usd/usd_names.h"
#include "io/usd/usd_splats.h"

namespace stipple {

namespace {

constexpr SplatFormatKeeps kAll = {.frame = true, .colour_space = true, .antialias = true};

std::string lowerName(const std::string& path) {
  std::string name = std::filesystem::path(path).filename().string();
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

std::vector<std::string> extensionsOf(const SplatFormat& format) {
  std::istringstream words(format.extensions);
  std::vector<std::string> extensions;
  for (std::string word; words >> word;) extensions.push_back(word);
  return extensions;
}

/// Length of the format's extension that the file name has; 0 for none.
size_t extensionLength(const SplatFormat& format, const std::string& name) {
  size_t longest = 0;
  for (const std::string& extension : extensionsOf(format)) {
    if (name.size() >= extension.size() &&
        name.compare(name.size() - extension.size(), extension.size(), extension) == 0) {
      longest = std::max(longest, extension.size());
    }
  }
  return longest;
}

SplatFileStart startOf(const std::string& path) {
  SplatFileStart start;
  start.path = path;
  start.name = lowerName(path);
  std::error_code ignored;
  start.is_folder = std::filesystem::is_directory(path, ignored);
  if (start.is_folder) return start;
  const InputFile file(path);
  start.bytes.resize(static_cast<size_t>(std::min<uint64_t>(file.size(), kSplatProbeBytes)));
  file.readAt(0, start.bytes.data(), start.bytes.size());
  return start;
}

}  // namespace

const std::vector<SplatFormat>& splatFormats() {
  static const std::vector<SplatFormat> kFormats = {
      {.name = "ply",
       .title = "3DGS PLY",
       .extensions = ".ply",
       .max_sh_degree = 4,
       .frame = Frame::kRDF,
       .keeps = kAll,
       .probe = startsAsPly,
       .read = readPlySplats,
       .write = writePlySplats,
       .estimate = estimatePlySplats,
       .checks_values = true},
      {.name = "compressed-ply",
       .title = "compressed PLY",
       .extensions = ".compressed.ply",
       .max_sh_degree = 3,
       .frame = Frame::kRDF,
       .keeps = kAll,
       .probe = startsAsCompressedPly,
       .read = readCompressedPly,
       .write = writeCompressedPly,
       .estimate = estimateCompressedPly,
       .checks_values = true},
      {.name = "spz",
       .title = "SPZ",
       .extensions = ".spz",
       .max_sh_degree = 4,
       .frame = Frame::kRUB,
       .keeps = {.frame = true, .antialias = true},
       .probe = startsAsSpz,
       .read = readSpzSplats,
       .write = writeSpzSplats,
       .estimate = estimateSpzSplats},
      {.name = "splat",
       .title = "splat records",
       .extensions = ".splat",
       .max_sh_degree = 0,
       .frame = Frame::kRDF,
       .read = readSplat32,
       .write = writeSplat32,
       .estimate = estimateSplat32,
       .checks_values = true,
       .takes_any_degree = true},
      {.name = "ksplat",
       .title = "ksplat",
       .extensions = ".ksplat",
       .max_sh_degree = 3,
       .frame = Frame::kRDF,
       .read = readKsplat},
      {.name = "gltf",
       .title = "glTF with KHR_gaussian_splatting",
       .extensions = ".glb .gltf",
       .max_sh_degree = 3,
       .frame = kGltfFrame,
       .keeps = kAll,
       .probe = startsAsGltfSplats,
       .read = readGltfSplats,
       .write = writeGltfSplats,
       .estimate = estimateGltfSplats,
       .checks_values = true},
      // Before SOG, which is a zip archive as packages of USD are.
      {.name = "usd",
       .title = "USD with ParticleField3DGaussianSplat",
       .extensions = ".usda .usd",
       .max_sh_degree = 4,
       .frame = kUsdFrame,
       .keeps = kAll,
       .probe = startsAsUsd,
       .read = readUsdSplats,
       .write = writeUsdSplats,
       .estimate = estimateUsdSplats,
       .holds_times = true},
      {.name = "usdz",
       .title = "USD package",
       .extensions = ".usdz",
       .max_sh_degree = 4,
       .frame = kUsdFrame,
       .keeps = kAll,
       .probe = startsAsUsdz,
       .read = readUsdSplats,
       .write = writeUsdSplats,
       .estimate = estimateUsdSplats,
       .holds_times = true},
      {.name = "sog_levels",
       .title = "streamed SOG",
       .extensions = "lod-meta.json",
       .max_sh_degree = 3,
       .frame = Frame::kRDF,
       .keeps = kAll,
       .probe = startsAsSogLevels,
       .read = readSogLevels,
       .write = [](const SplatCloud& cloud, const std::string& path, const SplatWriteOptions&,
                   Progress* progress) { writeSogLevels({&cloud}, nullptr, path, {}, progress); },
       .estimate = estimateSog},
      {.name = "sog",
       .title = "SOG",
       .extensions = ".sog meta.json",
       .max_sh_degree = 3,
       .frame = Frame::kRDF,
       .keeps = kAll,
       .probe = startsAsSog,
       .read = readSog,
       .write = [](const SplatCloud& cloud, const std::string& path, const SplatWriteOptions&,
                   Progress* progress) { writeSog(cloud, path, {}, progress); },
       .estimate = estimateSog},
      // Further formats go here.
  };
  return kFormats;
}

uint64_t estimatedFileBytes(const SplatFormat& format, uint64_t count, int degree,
                            const SplatWriteOptions& options) {
  if (format.estimate == nullptr) return 0;
  const int written = std::min({degree, options.sh_degree_limit, format.max_sh_degree});
  return static_cast<uint64_t>(std::llround(format.estimate(count, written, options)));
}

const SplatFormat* splatFormatOfExtension(const std::string& path) {
  const std::string name = lowerName(path);
  const SplatFormat* best = nullptr;
  size_t longest = 0;
  for (const SplatFormat& format : splatFormats()) {
    const size_t length = extensionLength(format, name);
    if (length > longest) best = &format;
    longest = std::max(longest, length);
  }
  return best;
}

const SplatFormat* splatFormatOfContent(const std::string& path) {
  const SplatFileStart start = startOf(path);
  for (const SplatFormat& format : splatFormats()) {
    if (format.read != nullptr && format.probe != nullptr && format.probe(start)) return &format;
  }
  // Some formats have no first bytes of their own.
  const SplatFormat* named = start.is_folder ? nullptr : splatFormatOfExtension(path);
  return named != nullptr && named->read != nullptr && named->probe == nullptr ? named : nullptr;
}

}  // namespace stipple
