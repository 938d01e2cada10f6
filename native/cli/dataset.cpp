#include "cli/dataset.h"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "cli/numbers.h"

namespace stipple::cli {

namespace {

/// "0:299" or "0:299:10", whole numbers of at most 18 digits.
std::optional<std::vector<uint64_t>> numbersOf(const std::string& text) {
  constexpr size_t kMostDigits = 18;
  std::vector<uint64_t> numbers;
  for (const std::string& part : CLI::detail::split(text, ':')) {
    const bool is_number =
        !part.empty() && part.size() <= kMostDigits &&
        std::all_of(part.begin(), part.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (!is_number) return std::nullopt;
    numbers.push_back(std::stoull(part));
  }
  if (numbers.size() < 2 || numbers.size() > 3) return std::nullopt;
  return numbers;
}

}  // namespace

void SeriesFlags::addTo(CLI::App& command) {
  const char* group = "Series of images";
  command
      .add_option("--frames", frames_,
                  "Frames from the first to the last of these, and of them each STEP-th: by their "
                  "numbers, or counted from 0 where the data set says times.")
      ->type_name("FIRST:LAST[:STEP]")
      ->group(group);
  command
      .add_option("--frame-rate", frame_rate_,
                  "Numbered images of a camera are so many per second: image n is of n divided by "
                  "this. Default: 30.")
      ->group(group);
  command
      .add_option("--max-images", max_images_,
                  "At most this number of images is used, spread evenly over frames and cameras; "
                  "0: all.")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--held-out-cameras", held_out_,
                  "These cameras, by the names of their folders with commas between, are measured "
                  "and not learned from, instead of those of --holdout: cam00, as published "
                  "results of Neural 3D Video have it.")
      ->type_name("NAMES")
      ->group(group);
}

void SeriesFlags::set(bool is_moving, StippleViewsOpenOptions& options) const {
  options.with_frames = is_moving || frames_ || frame_rate_ || held_out_ ? 1 : 0;
  if (frame_rate_) {
    if (!(*frame_rate_ > 0)) throw Failure("--frame-rate must be above 0");
    options.frame_rate = *frame_rate_;
  }
  options.max_images = counted(max_images_, "--max-images", 0);
  if (held_out_) {
    if (held_out_->empty()) throw Failure("--held-out-cameras names no camera");
    options.held_out_cameras_utf8 = held_out_->c_str();
  }
  if (!frames_) return;
  const auto numbers = numbersOf(*frames_);
  if (!numbers) {
    throw Failure("--frames is '" + *frames_ +
                  "'; FIRST:LAST or FIRST:LAST:STEP in whole numbers is expected, as 0:299:10");
  }
  options.first_frame = (*numbers)[0];
  options.last_frame = (*numbers)[1];
  if (numbers->size() > 2) options.frame_step = (*numbers)[2];
}

Views openViews(const Context& context, const std::string& dataset, int64_t downscale,
                const SeriesFlags* series, bool is_moving) {
  StippleViewsOpenOptions options;
  stipple_views_open_options_init(&options);
  options.downscale = counted32(downscale, "--downscale");
  options.cache_bytes = 0;  // who works with them keeps them
  if (series) series->set(is_moving, options);
  return make<Views>(stipple_views_open, context.get(), dataset.c_str(),
                     const_cast<const StippleViewsOpenOptions*>(&options));
}

void printSeries(const Views& views) {
  auto info = sized<StippleViewsInfo>();
  check(stipple_views_info(views.get(), &info));
  if (info.frame_count < 2 && info.view_count == info.found_count) return;
  std::string text = std::to_string(info.view_count) + " of " + std::to_string(info.found_count) +
                     " images are used";
  if (info.frame_count > 1) {
    char times[80];
    std::snprintf(times, sizeof(times), "%llu times, %.6g s to %.6g s",
                  static_cast<unsigned long long>(info.frame_count), info.time_begin,
                  info.time_end);
    text += ", of " + std::string(times);
  }
  if (info.camera_count > 0 && info.frame_count > 1) {
    text += ", by " + std::to_string(info.camera_count) +
            (info.camera_count == 1 ? " camera" : " cameras") + " of several images";
  }
  std::fprintf(stderr, "stipple: %s\n", text.c_str());
}

}  // namespace stipple::cli
