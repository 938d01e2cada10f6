#include "io/splats/splat_file.h"

#include <algorithm>
#include <deque>
#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "data/clouds/sh_degree.h"
#include "data/clouds/splat_colour.h"
#include "io/bytes/input_file.h"
#include "io/splats/sog_levels.h"

namespace stipple {

namespace {

/// "3DGS PLY (.ply), SPZ (.spz) and ..." of the formats that can be read (or written).
std::string listOfFormats(bool written) {
  std::vector<std::string> parts;
  for (const SplatFormat& format : splatFormats()) {
    if (written ? format.write == nullptr : format.read == nullptr) continue;
    parts.push_back(std::string(format.title) + " (" + format.extensions + ")");
  }
  std::string text;
  for (size_t i = 0; i < parts.size(); ++i) {
    if (i > 0) text += i + 1 == parts.size() ? " and " : ", ";
    text += parts[i];
  }
  return text;
}

/// What a cloud needs before a format takes it.
struct Changes {
  int degree;  ///< of harmonics that are kept
  Frame frame;
  bool cuts, turns, recolours;

  bool any() const { return cuts || turns || recolours; }
};

Changes changesFor(const SplatCloud& cloud, const SplatFormat& format,
                   const SplatWriteOptions& options) {
  Changes changes;
  changes.degree = std::min(options.sh_degree_limit, format.max_sh_degree);
  changes.frame = options.frame == Frame::kUnknown ? format.frame : options.frame;
  // Without a frame, a cloud stays so where the format's own is what it counts as.
  changes.turns = cloud.frame == Frame::kUnknown
                      ? changes.frame != kConventionalFrame || options.frame != Frame::kUnknown
                      : cloud.frame != changes.frame;
  changes.recolours = cloud.colour_space == ColourSpace::kLinear && !format.keeps.colour_space;
  changes.cuts = cloud.sh_degree > changes.degree &&
                 !(format.takes_any_degree && format.max_sh_degree <= options.sh_degree_limit);
  return changes;
}

/// The cloud as a format takes it, where that differs from the cloud as it is. In: a valid cloud.
std::optional<SplatCloud> prepared(const SplatCloud& cloud, const Changes& changes) {
  if (!changes.any()) return std::nullopt;
  SplatCloud copy = withShDegree(cloud, std::min(cloud.sh_degree, changes.degree));
  if (changes.recolours) convertColours(copy, ColourSpace::kDisplay);
  if (changes.turns) convertFrame(copy, changes.frame);
  return copy;
}

void checkDegreeLimit(const SplatWriteOptions& options) {
  if (options.sh_degree_limit < 0 || options.sh_degree_limit > kMaxShDegree) {
    fail(ErrorCode::kInvalidArgument, "the limit of the harmonic degree is " +
                                          std::to_string(options.sh_degree_limit) +
                                          "; 0 to 4 is allowed");
  }
}

}  // namespace

SplatCloud readSplatFile(const std::string& path, Progress* progress) {
  if (const SplatFormat* format = splatFormatOfContent(path)) return format->read(path, progress);
  std::error_code ignored;
  // A folder that no format knows gets the words of every reader.
  if (std::filesystem::is_directory(path, ignored)) const InputFile file(path);
  // A file that is named after a format and is not of it gets that reader's words.
  const SplatFormat* named = splatFormatOfExtension(path);
  if (named != nullptr && named->read != nullptr) return named->read(path, progress);
  fail(ErrorCode::kFormat, path + " is not a splat file that can be read: its extension is '" +
                               lowerExtension(path) +
                               "' and its first bytes are those of no format; " +
                               listOfFormats(false) + " can be read");
}

void writeSplatFile(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress) {
  const SplatFormat* format = splatFormatOfExtension(path);
  if (format == nullptr || format->write == nullptr) {
    fail(ErrorCode::kUnsupported, path + " cannot be written as splats: its extension is '" +
                                      lowerExtension(path) + "'; " + listOfFormats(true) +
                                      " can be written");
  }
  checkDegreeLimit(options);
  validateSizes(cloud, "cloud");
  const Changes changes = changesFor(cloud, *format, options);
  if (!format->checks_values || changes.any()) validate(cloud, "cloud");
  const std::optional<SplatCloud> changed = prepared(cloud, changes);
  format->write(changed ? *changed : cloud, path, options, progress);
}

std::optional<SplatCloud> asWritten(const SplatCloud& cloud, const SplatFormat& format,
                                    const SplatWriteOptions& options) {
  checkDegreeLimit(options);
  return prepared(cloud, changesFor(cloud, format, options));
}

void writeSplatLevels(const std::vector<const SplatCloud*>& levels, const SplatCloud* environment,
                      const std::string& path, const SplatWriteOptions& options,
                      Progress* progress) {
  const SplatFormat* format = splatFormatOfExtension(path);
  if (format == nullptr || format->name != std::string_view("sog_levels")) {
    fail(ErrorCode::kUnsupported,
         path + " cannot be written as levels: it is not named lod-meta.json");
  }
  checkDegreeLimit(options);
  std::vector<const SplatCloud*> clouds = levels;
  clouds.push_back(environment);
  std::deque<SplatCloud> changed;
  for (const SplatCloud*& cloud : clouds) {
    if (cloud == nullptr) continue;
    validate(*cloud, cloud == environment ? "environment" : "level");
    if (auto copy = asWritten(*cloud, *format, options)) {
      cloud = &changed.emplace_back(std::move(*copy));
    }
  }
  environment = clouds.back();
  clouds.pop_back();
  writeSogLevels(clouds, environment, path, {}, progress);
}

}  // namespace stipple
