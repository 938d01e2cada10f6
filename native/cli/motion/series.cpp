#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/formats.h"
#include "cli/library.h"
#include "cli/numbers.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

constexpr char kNumber = '#';

struct Arguments {
  std::vector<std::string> files;  ///< the last one is written
  std::string frame;
  double rate = 24.0;
  int64_t first = 1;
  int64_t anchors = 0;
  uint32_t degree = 4;
  bool half = false;
  bool json = false;
};

/// Frames of a model that moves, from when to when something moves in it.
struct Motion {
  Model model;
  StippleDecodeOptions options;
  double begin = 0;
  uint64_t count = 0;
};

Motion motionOf(const Context& context, const std::string& path, const Arguments& arguments) {
  Motion motion;
  motion.model = make<Model>(stipple_model_load, context.get(), path.c_str());
  auto settings = sized<StippleModelSettings>();
  check(stipple_model_settings(motion.model.get(), &settings));
  if (!settings.has_time) {
    throw Failure("'" + path +
                  "' holds a model that does not move; stipple decode makes its splats");
  }
  stipple_decode_options_init(&motion.options);
  motion.options.gaussians_per_anchor = settings.default_gaussians_per_anchor;
  motion.options.anchor_count = settings.default_budget;
  if (arguments.anchors != 0) {
    motion.options.anchor_count = counted(arguments.anchors, "--anchors");
  }
  motion.begin = settings.time_begin;
  const double frames = (settings.time_end - settings.time_begin) * arguments.rate;
  constexpr double kMostFrames = 1e6;
  if (!(frames >= 0 && frames < kMostFrames)) {
    throw Failure("'" + path + "' would have " + std::to_string(frames) +
                  " frames; fewer than a million can be written");
  }
  motion.count = static_cast<uint64_t>(std::llround(frames)) + 1;
  return motion;
}

StippleCloudSaveOptions saveOptions(const Arguments& arguments) {
  StippleCloudSaveOptions options;
  stipple_cloud_save_options_init(&options);
  options.sh_degree_limit = arguments.degree;
  options.half = arguments.half ? 1 : 0;
  if (!arguments.frame.empty()) options.frame = frameOfName(arguments.frame);
  return options;
}

void say(const Arguments& arguments, uint64_t frames, uint64_t splats) {
  Report report;
  report.add("frames", frames);
  report.add("splats", splats);
  report.print(arguments.json);
}

uint64_t countOf(const Cloud& cloud) {
  auto info = sized<StippleCloudInfo>();
  check(stipple_cloud_info(cloud.get(), &info));
  return info.count;
}

/// A file with splats at times becomes a file for each. In: out, with a run of '#' in its name.
void splitSeries(const Context& context, const Arguments& arguments, const std::string& out) {
  const size_t begin = out.find(kNumber, out.find_last_of('/') + 1);
  const size_t end = std::min(out.find_first_not_of(kNumber, begin), out.size());
  if (out.find(kNumber, end) != std::string::npos) {
    throw Failure("'" + out + "' has two places for a number; files are told apart by one");
  }
  if (arguments.files.size() != 2 || arguments.anchors != 0) {
    throw Failure("'" + out + "' is the name of many files, which one file of USD is split into");
  }
  const auto reader = make<SeriesReader>(stipple_series_reader_create, context.get(),
                                         arguments.files.front().c_str());
  auto info = sized<StippleSeriesInfo>();
  check(stipple_series_reader_info(reader.get(), &info));
  const StippleCloudSaveOptions options = saveOptions(arguments);
  const uint64_t count = std::max<uint64_t>(info.frame_count, 1);
  uint64_t splats = 0;
  for (uint64_t i = 0; i < count; ++i) {
    double frame = 0;
    const auto cloud = make<Cloud>(stipple_series_reader_read, reader.get(), i, &frame);
    const std::string number = std::to_string(arguments.first + static_cast<int64_t>(i));
    const std::string zeros(end - begin - std::min(number.size(), end - begin), '0');
    const std::string path = out.substr(0, begin) + zeros + number + out.substr(end);
    check(stipple_cloud_save(cloud.get(), path.c_str(), &options));
    splats += countOf(cloud);
  }
  say(arguments, count, splats);
}

void writeSeries(const Context& context, const Arguments& arguments) {
  if (arguments.files.size() < 2) {
    throw Failure("a series needs files to read, or a model that moves, and a file to write");
  }
  const std::string& out = arguments.files.back();
  if (out.find(kNumber, out.find_last_of('/') + 1) != std::string::npos) {
    splitSeries(context, arguments, out);
    return;
  }
  const std::vector<std::string> files(arguments.files.begin(), arguments.files.end() - 1);
  const bool of_model = hasModelExtension(files.front());
  if (of_model && files.size() > 1) {
    throw Failure("'" + files.front() + "' holds a model; a series is of one model or of splats");
  }
  if (!of_model && arguments.anchors != 0) {
    throw Failure("--anchors is of models that move; '" + files.front() + "' holds splats");
  }
  Motion motion;
  if (of_model) motion = motionOf(context, files.front(), arguments);
  const StippleCloudSaveOptions options = saveOptions(arguments);
  const auto writer = make<SeriesWriter>(stipple_series_writer_create, context.get(), out.c_str(),
                                         arguments.rate, &options);
  const uint64_t count = of_model ? motion.count : files.size();
  uint64_t splats = 0;
  for (uint64_t i = 0; i < count; ++i) {
    Cloud cloud;
    if (of_model) {
      motion.options.time = motion.begin + static_cast<double>(i) / arguments.rate;
      cloud = make<Cloud>(stipple_model_decode, motion.model.get(), &motion.options);
    } else {
      cloud = make<Cloud>(stipple_cloud_load, context.get(), files[i].c_str());
    }
    check(stipple_series_writer_add(
        writer.get(), cloud.get(), static_cast<double>(arguments.first + static_cast<int64_t>(i))));
    splats += countOf(cloud);
  }
  check(stipple_series_writer_finish(writer.get()));
  say(arguments, count, splats);
}

}  // namespace

void addSeries(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "series",
      "Splats of several frames to one file that plays (USD with time samples), and back");
  command
      ->add_option(
          "files", arguments->files,
          "Splat files, a frame each in their order, or a model of splats that move "
          "(.stipple.safetensors); then the file to write (.usda, .usd, .usdz). Or one such "
          "file, and what a file of each frame is named, with # for digits: walk_####.ply")
      ->required();
  command->add_option("--frame-rate", arguments->rate, "Frames per second")->capture_default_str();
  command->add_option("--first", arguments->first, "Number of the first frame")
      ->capture_default_str();
  command->add_option("--anchors", arguments->anchors,
                      "Budget of a model; without it what suits it");
  command
      ->add_option("--degree", arguments->degree, "Leave out harmonics above this degree, 0 to 4")
      ->capture_default_str();
  command->add_option("--frame", arguments->frame,
                      "Frame that positions are written in, RUB (Y up) or RFU (Z up)");
  command->add_flag("--half", arguments->half, "All but positions in half precision");
  command->add_flag("--json", arguments->json, "Figures as JSON");
  command->callback([arguments, &context] { writeSeries(context, *arguments); });
}

}  // namespace stipple::cli
