#include "io/assets/relay_asset.h"

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/number_text.h"
#include "io/assets/asset_time.h"
#include "io/assets/network_tensors.h"
#include "io/bytes/json_text.h"

namespace stipple {

namespace {

using Json = nlohmann::json;

constexpr char kClip[] = "clip";
constexpr char kCounts[] = "relay.anchor_counts";
constexpr char kBounds[] = "relay.bounds";
constexpr uint64_t kMostGaussians = 32;
constexpr double kMostFrames = 1 << 24;

std::string prefixOf(uint32_t key) {
  return "key." + std::to_string(key) + ".";
}

bool isOfKeyFrame(const std::string& name, size_t key_count) {
  if (!name.starts_with("key.")) return false;
  uint32_t key = 0;
  const char* end = name.data() + name.size();
  const auto [dot, error] = std::from_chars(name.data() + 4, end, key);
  return error == std::errc() && dot != end && *dot == '.' && key < key_count;
}

double lastSecond(const RelayAssetHead& head) {
  return head.begin + (head.frame_count - 1) / head.frames_per_second;
}

void validateHead(const RelayAssetHead& head, const std::string& name, ErrorCode code) {
  const bool holds = std::isfinite(head.begin) && std::isfinite(head.frames_per_second) &&
                     head.frames_per_second > 0 && head.frame_count >= 1 && head.spacing >= 1 &&
                     head.blend <= 3 && std::isfinite(lastSecond(head));
  if (!holds) {
    fail(code, name + " has a clip of " + std::to_string(head.frame_count) + " frames at " +
                   numberText(head.frames_per_second) + " a second from " + numberText(head.begin) +
                   " s, with key frames every " + std::to_string(head.spacing) +
                   "; that is no clip");
  }
  if (head.anchor_counts.empty()) fail(code, name + " has 0 key frames; at least 1 is needed");
}

uint32_t wholeOf(const Json& clip, const char* key, double least, double most,
                 const std::string& path) {
  const double value = clip.is_object() && clip.contains(key) && clip[key].is_number()
                           ? clip[key].get<double>()
                           : -1;
  if (!(value >= least && value <= most) || value != std::floor(value)) {
    fail(ErrorCode::kFormat, path + " has a clip without a whole number '" + key + "' from " +
                                 numberText(least) + " to " + numberText(most));
  }
  return static_cast<uint32_t>(value);
}

double numberOf(const Json& clip, const char* key, const std::string& path) {
  if (!clip.is_object() || !clip.contains(key) || !clip[key].is_number()) {
    fail(ErrorCode::kFormat, path + " has a clip without a number '" + key + "'");
  }
  return clip[key].get<double>();
}

}  // namespace

void writeRelayAsset(const RelayAssetHead& head,
                     const std::function<TensorTable(uint32_t number)>& key,
                     const std::string& path) {
  validateHead(head, "asset", ErrorCode::kInvalidArgument);
  SafeTensorsWriter file;
  setAssetKind(file, kAssetRelay);
  setSplatFlags(file, head.colour_space, head.antialias);
  file.setMetadata("frame", "right-handed, z up, metres");
  file.setMetadata("K", std::to_string(head.gaussians));
  file.setMetadata("sh_degree", std::to_string(head.sh_degree));
  file.setMetadata(kClip, Json({{"begin", head.begin},
                                {"frames", head.frame_count},
                                {"frames_per_second", head.frames_per_second},
                                {"first_key", head.first_key},
                                {"spacing", head.spacing},
                                {"blend", head.blend}})
                              .dump());
  file.setMetadata("settings",
                   settingsWithTime(head.settings_json, {head.begin, lastSecond(head)}));
  file.add(kCounts, head.anchor_counts, 1);
  const Tensor bounds{{2, 3}, std::vector<double>(head.bounds.begin(), head.bounds.end())};
  file.add(kBounds, bounds);
  // Names sort by key frames, so that each is fetched once for the header and once for its values.
  uint32_t number = 0;
  TensorTable kept;
  for (uint32_t k = 0; k < head.anchor_counts.size(); ++k) {
    kept = key(number = k);
    for (const auto& [name, tensor] : kept) {
      file.addLater(prefixOf(k) + name, tensor, [&, k, name = name]() -> const Tensor& {
        if (number != k) kept = key(number = k);
        return kept.at(name);
      });
    }
  }
  addAssetExtras(file, head.extras);
  file.write(path);
}

RelayAsset::RelayAsset(const std::string& path)
    : file_(std::make_unique<const SafeTensorsReader>(path)) {
  requireAssetKind(*file_, kAssetRelay);
  readSplatFlags(*file_, head_.colour_space, head_.antialias);
  head_.gaussians = static_cast<uint32_t>(requireWhole(*file_, "K", 1, kMostGaussians));
  head_.sh_degree = static_cast<int>(requireWhole(*file_, "sh_degree", 0, kMaxShDegree));
  const Json clip = parseJson(requireText(*file_, kClip), path + ": the metadata '" + kClip + "'");
  head_.begin = numberOf(clip, "begin", path);
  head_.frames_per_second = numberOf(clip, "frames_per_second", path);
  head_.frame_count = wholeOf(clip, "frames", 1, kMostFrames, path);
  // Files of before 29 November 2026 have their first key frame at frame 0.
  if (clip.contains("first_key")) {
    head_.first_key = wholeOf(clip, "first_key", 0, kMostFrames, path);
  }
  head_.spacing = wholeOf(clip, "spacing", 1, kMostFrames, path);
  head_.blend = wholeOf(clip, "blend", 0, 3, path);
  head_.anchor_counts = file_->readUint64s(kCounts, 1);
  const Tensor bounds = file_->readTensor(kBounds);
  const auto* numbers = std::get_if<std::vector<double>>(&bounds.values);
  if (numbers == nullptr || numbers->size() != head_.bounds.size()) {
    fail(ErrorCode::kFormat, path + ": tensor " + kBounds + " is not six numbers of float64");
  }
  std::copy(numbers->begin(), numbers->end(), head_.bounds.begin());
  head_.settings_json = requireText(*file_, "settings");
  validateHead(head_, path, ErrorCode::kFormat);
  head_.extras.metadata = file_->metadata();
  head_.extras.tensors = file_->readOthers(
      [&](const std::string& name) { return isOfKeyFrame(name, head_.anchor_counts.size()); });
}

RelayAsset::~RelayAsset() = default;

TensorTable RelayAsset::key(uint32_t number) const {
  const std::string prefix = prefixOf(number);
  TensorTable table;
  for (auto found = file_->tensors().lower_bound(prefix); found != file_->tensors().end();
       ++found) {
    if (!found->first.starts_with(prefix)) break;
    table[found->first.substr(prefix.size())] = file_->readTensor(found->first);
  }
  return table;
}

}  // namespace stipple
