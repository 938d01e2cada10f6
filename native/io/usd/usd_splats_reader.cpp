// Based on: OpenUSD 26.03, schema UsdVol (ParticleField3DGaussianSplat and the applied schemas of
// its attributes): single precision before half, longer arrays are cut, arrays that are missing
// have the schema's fallback. Differs: arrays that are too short are a fault of the file.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "data/clouds/cloud_transform.h"
#include "io/bytes/input_file.h"
#include "io/bytes/limits.h"
#include "io/bytes/zip_file.h"
#include "io/splats/cloud_parts.h"
#include "io/splats/quantize.h"
#include "io/splats/splat_check.h"
#include "io/usd/usd_names.h"
#include "io/usd/usd_splats.h"
#include "io/usd/usd_stage.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr size_t kGrain = 4096;
constexpr uint64_t kMaxLayerBytes = uint64_t{1} << 36;
constexpr std::string_view kBinaryHead = "PXR-USDC", kTextHead = "#usda", kZipHead = "PK\3\4";
constexpr char kStage[] = "Reading splats";

void requireText(std::string_view start, const std::string& name) {
  if (!start.starts_with(kBinaryHead)) return;
  fail(ErrorCode::kUnsupported,
       name +
           " is a USD layer of the binary kind; those of text (.usda) can be read, which "
           "'usdcat' and Blender's own USD export make of it");
}

/// Of an attribute in single precision and in half.
struct Names {
  const char *single, *half;
};
constexpr Names kPositions = {kUsdPositions, kUsdPositionsHalf};
constexpr Names kOrientations = {kUsdOrientations, kUsdOrientationsHalf};
constexpr Names kScales = {kUsdScales, kUsdScalesHalf};
constexpr Names kOpacities = {kUsdOpacities, kUsdOpacitiesHalf};
constexpr Names kCoefficients = {kUsdCoefficients, kUsdCoefficientsHalf};

/// The splats of one prim, in its own space.
class Part {
 public:
  Part(const UsdNode& node, std::string what) : node_(node), what_(std::move(what)) {}

  SplatCloud cloud(Frame frame, size_t already, uint64_t file_bytes) {
    const std::vector<float>* positions = array(kPositions);
    if (positions == nullptr) return {};
    count_ = positions->size() / 3;
    SplatCloud cloud;
    cloud.sh_degree = degree();
    requireAllowed(cloudBytes(already + count_, cloud.sh_degree), kSplatAllowance, file_bytes,
                   what_, "the splats of the file");
    cloud.resize(count_);
    take(kPositions, 3, 0.0f, cloud.positions);
    take(kScales, 3, 1.0f, cloud.scales);
    take(kOpacities, 1, 1.0f, cloud.opacities);
    take(kOrientations, 4, 0.0f, cloud.rotations);
    take(kCoefficients, cloud.shStride(), 0.0f, cloud.sh);
    parallelFor(count_, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) normaliseRotation(&cloud.rotations[i * 4]);
    });
    const UsdValue* space = node_.value(kUsdColourSpace);
    if (space != nullptr && !space->words.empty() && space->words.front().starts_with("lin_")) {
      if (space->words.front().find("rec709") == std::string::npos) {
        fail(ErrorCode::kUnsupported, what_ + " has colours of the space '" +
                                          space->words.front().substr(0, 100) +
                                          "'; of linear ones, those of Rec.709 can be read");
      }
      cloud.colour_space = ColourSpace::kLinear;
    }
    const std::string group = std::string(kUsdGroup) + ":";
    if (node_.custom(group + kUsdAntialiasKey) == kUsdMip) cloud.antialias = Antialias::kMip;
    cloud.frame = frameFromName(node_.custom(group + kUsdFrameKey)).value_or(frame);
    return cloud;
  }

 private:
  [[noreturn]] void failHere(const std::string& what) const {
    fail(ErrorCode::kFormat, what_ + " " + what);
  }

  /// In single precision or half; null where it is not there.
  const std::vector<float>* array(const Names& names) const {
    for (const char* one : {names.single, names.half}) {
      const UsdValue* value = node_.value(one);
      if (value != nullptr && !value->floats.empty()) return &value->floats;
    }
    return nullptr;
  }

  int degree() const {
    if (array(kCoefficients) == nullptr) return 0;
    const UsdValue* value = node_.value(kUsdDegree);
    if (value == nullptr || value->numbers.empty()) return 3;
    const double degree = value->numbers.front();
    if (!(degree >= 0 && degree <= kMaxShDegree) || degree != std::floor(degree)) {
      failHere("has harmonics of degree " + std::to_string(degree) + "; 0 to 4 can be read");
    }
    return static_cast<int>(degree);
  }

  /// In: width, numbers of a splat; otherwise, what they are where the array is missing.
  void take(const Names& names, size_t width, float otherwise, std::vector<float>& values) const {
    const std::vector<float>* stored = array(names);
    if (stored == nullptr) {
      std::fill(values.begin(), values.end(), otherwise);
      return;
    }
    if (stored->size() < count_ * width) {
      failHere("has " + std::to_string(stored->size()) + " numbers of " + names.single + "; its " +
               std::to_string(count_) + " splats need " + std::to_string(count_ * width));
    }
    std::copy_n(stored->begin(), count_ * width, values.begin());
  }

  const UsdNode& node_;
  std::string what_;
  size_t count_ = 0;
};

/// What a stage draws at its time; without splats, where it draws none.
SplatCloud splatsOf(UsdStage& stage, const std::string& path, uint64_t file_bytes,
                    Progress* progress) {
  const UsdLayer& layer = stage.layer();
  const Frame frame = layer.up_axis == "Z" ? kUsdFrameOfZUp : kUsdFrame;
  const double metres = layer.metres_per_unit.value_or(1.0);
  if (!(metres > 0) || !std::isfinite(metres)) {
    fail(ErrorCode::kFormat,
         path + " has units of " + std::to_string(metres) + " metres; a number above 0 is needed");
  }
  Mat4d in_metres = Mat4d::Identity();
  in_metres.topLeftCorner<3, 3>() *= metres;
  std::vector<SplatCloud> parts;
  size_t count = 0;
  stage.visit([&](const UsdNode& node, const std::string& prim, const Mat4d& matrix) {
    if (node.type() != kUsdSplats) return;
    advance(progress, 0.6, kStage);
    const std::string what = path + ": " + prim;
    SplatCloud part = Part(node, what).cloud(frame, count, file_bytes);
    if (part.size() == 0) return;
    count += part.size();
    try {
      validate(part, "part");
      const Mat4d place = in_metres * matrix;
      if (place != Mat4d::Identity()) part = transformed(part, place);
    } catch (const Error& error) {
      fail(ErrorCode::kFormat, what + ": " + error.what());
    }
    parts.push_back(std::move(part));
    const SplatCloud &first = parts.front(), &last = parts.back();
    if (last.colour_space != first.colour_space || last.antialias != first.antialias ||
        last.frame != first.frame) {
      fail(ErrorCode::kUnsupported, path +
                                        " holds splats of several colour spaces, low-pass "
                                        "filters or frames; one of each is needed");
    }
  });
  advance(progress, 0.9, kStage);
  if (parts.empty()) {
    SplatCloud nothing;
    nothing.frame = frame;
    return nothing;
  }
  return parts.size() == 1 ? std::move(parts.front()) : joined(parts);
}

std::string textOf(const std::vector<uint8_t>& bytes) {
  return std::string(bytes.begin(), bytes.end());
}

}  // namespace

bool startsAsUsd(const SplatFileStart& start) {
  return start.bytes.starts_with(kTextHead) || start.bytes.starts_with(kBinaryHead);
}

bool startsAsUsdz(const SplatFileStart& start) {
  return start.name.ends_with(".usdz") && start.bytes.starts_with(kZipHead);
}

struct UsdSplatsReader::Open {
  explicit Open(const std::string& of_path) : path(of_path), file(of_path) {
    if (lowerExtension(path) == ".usdz") package.emplace(file);
    std::string root, folder;
    if (package) {
      root = package->firstName();
      folder = root.substr(0, root.find_last_of('/') + 1);
    }
    stage = std::make_unique<UsdStage>(
        path, package ? ofPackage(root) : ofFolder(path), [this, folder](const std::string& name) {
          return package ? ofPackage(folder + name)
                         : ofFolder((fs::path(path).parent_path() / name).string());
        });
  }

  std::string ofPackage(const std::string& name) const {
    std::string text = textOf(package->read(name, kMaxLayerBytes));
    requireText(text, path + ": " + name);
    return text;
  }

  static std::string ofFolder(const std::string& name) {
    std::string text = readTextFile(name, kMaxLayerBytes);
    requireText(text, name);
    return text;
  }

  std::string path;
  InputFile file;
  std::optional<ZipReader> package;  ///< nothing: a layer
  std::unique_ptr<UsdStage> stage;
};

UsdSplatsReader::UsdSplatsReader(const std::string& path) : open_(std::make_unique<Open>(path)) {
  const std::set<double> times = open_->stage->timesOf(kUsdSplats);
  times_.assign(times.begin(), times.end());
}

UsdSplatsReader::~UsdSplatsReader() = default;

double UsdSplatsReader::framesPerSecond() const {
  constexpr double kFallback = 24.0;
  const UsdLayer& layer = open_->stage->layer();
  for (const std::optional<double>& rate : {layer.time_codes_per_second, layer.frames_per_second}) {
    if (rate && *rate > 0 && std::isfinite(*rate)) return *rate;
  }
  return kFallback;
}

SplatCloud UsdSplatsReader::still(Progress* progress) {
  open_->stage->setTime(std::nullopt);
  SplatCloud cloud = splatsOf(*open_->stage, open_->path, open_->file.size(), progress);
  if (cloud.size() == 0) {
    fail(ErrorCode::kFormat, open_->path + " draws no splats: it has no prim of type " +
                                 kUsdSplats + " that is active, visible and not empty");
  }
  return cloud;
}

SplatCloud UsdSplatsReader::at(double time) {
  open_->stage->setTime(time);
  return splatsOf(*open_->stage, open_->path, open_->file.size(), nullptr);
}

SplatCloud readUsdSplats(const std::string& path, Progress* progress) {
  advance(progress, 0.0, kStage);
  return UsdSplatsReader(path).still(progress);
}

}  // namespace stipple
