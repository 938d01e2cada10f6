// Based on: OpenUSD documentation, "TimeSamples": samples by time code, which metadata of the layer
// makes frames of so many a second.
#include "io/usd/usd_series_writer.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "io/bytes/input_file.h"
#include "io/splats/splat_file.h"
#include "io/usd/usd_layer_text.h"

namespace stipple {

namespace {

constexpr size_t kCopyBytes = size_t{1} << 20;

/// The shortest decimal that reads back as the same number.
std::string exactText(double value) {
  char digits[32];
  return std::string(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
}

const SplatFormat* formatOfSeries(const std::string& path) {
  const SplatFormat* format = splatFormatOfExtension(path);
  if (format == nullptr || !format->holds_times) {
    fail(ErrorCode::kUnsupported, path +
                                      " cannot hold splats at several times; .usda, .usd and "
                                      ".usdz can");
  }
  return format;
}

}  // namespace

UsdSeriesWriter::UsdSeriesWriter(const std::string& path, double frames_per_second,
                                 const SplatWriteOptions& options)
    : format_(formatOfSeries(path)),
      file_(path),
      path_(path),
      options_(options),
      frames_per_second_(frames_per_second) {
  if (!std::isfinite(frames_per_second) || !(frames_per_second > 0)) {
    fail(ErrorCode::kInvalidArgument,
         "frames per second are " + numberText(frames_per_second) + "; a number above 0 is needed");
  }
  for (size_t i = 0; i < 1 + usdArrays(0, false).size(); ++i) {
    samples_.push_back(std::make_unique<OutputFile>(path));
  }
}

void UsdSeriesWriter::put(size_t array, const std::string& text) {
  samples_[array]->write(text.data(), text.size());
}

void UsdSeriesWriter::add(const SplatCloud& cloud, double frame) {
  if (!std::isfinite(frame) || (last_ && !(frame > *last_))) {
    fail(ErrorCode::kInvalidArgument, "frame " + numberText(frame) + " comes after frame " +
                                          (last_ ? numberText(*last_) : std::string("0")) +
                                          "; frames must ascend");
  }
  validate(cloud, "cloud");
  std::optional<SplatCloud> changed;
  if (cloud.size() > 0) changed = asWritten(cloud, *format_, options_);
  const SplatCloud& written = changed ? *changed : cloud;
  if (written.size() > 0 && !like_) {
    like_.emplace();
    like_->sh_degree = written.sh_degree;
    like_->colour_space = written.colour_space;
    like_->antialias = written.antialias;
    like_->frame = written.frame;
  }
  if (written.size() > 0 &&
      (written.sh_degree != like_->sh_degree || written.colour_space != like_->colour_space ||
       written.antialias != like_->antialias || written.frame != like_->frame)) {
    fail(ErrorCode::kInvalidArgument,
         "frame " + numberText(frame) + " has harmonics of degree " +
             std::to_string(written.sh_degree) + ", those before it of degree " +
             std::to_string(like_->sh_degree) +
             ", or another colour space, low-pass filter or frame of axes; one of each is needed");
  }
  const std::string time = "        " + exactText(frame) + ": ";
  put(0, time + usdExtent(written) + ",\n");
  if (options_.half) requireHalves(written, path_);
  const std::array<UsdArray, 5> arrays = usdArrays(written.sh_degree, options_.half);
  for (size_t i = 0; i < arrays.size(); ++i) {
    put(i + 1, time + "[\n");
    putUsdRows(
        arrays[i], written, [&](const std::string& text) { put(i + 1, text); }, [](size_t) {});
    put(i + 1, "        ],\n");
  }
  if (!first_) first_ = frame;
  last_ = frame;
}

void UsdSeriesWriter::finish() {
  if (!like_) {
    fail(ErrorCode::kInvalidArgument, path_ + " cannot be written: none of its frames has a splat");
  }
  const std::string rate = exactText(frames_per_second_);
  file_.put(usdLayerHead(*like_, "    framesPerSecond = " + rate + "\n    timeCodesPerSecond = " +
                                     rate + "\n    startTimeCode = " + exactText(*first_) +
                                     "\n    endTimeCode = " + exactText(*last_) + "\n"));
  const std::array<UsdArray, 5> arrays = usdArrays(like_->sh_degree, options_.half);
  std::string piece;
  for (size_t i = 0; i < samples_.size(); ++i) {
    file_.put(i == 0 ? std::string("    float3[] extent.timeSamples = {\n")
                     : std::string("    ") + arrays[i - 1].type + " " + arrays[i - 1].name +
                           ".timeSamples = {\n");
    samples_[i]->handOver();
    const InputFile text(samples_[i]->temporaryPath());
    for (uint64_t at = 0; at < text.size(); at += piece.size()) {
      piece.resize(static_cast<size_t>(std::min<uint64_t>(kCopyBytes, text.size() - at)));
      text.readAt(at, piece.data(), piece.size());
      file_.put(piece);
    }
    samples_[i].reset();
    file_.put("    }\n");
  }
  file_.put("}\n");
  file_.commit();
}

}  // namespace stipple
