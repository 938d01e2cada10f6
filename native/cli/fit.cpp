#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include "cli/commands.h"
#include "cli/dataset.h"
#include "cli/fit_flags.h"
#include "cli/formats.h"
#include "cli/hierarchy.h"
#include "cli/jobs/status_line.h"
#include "cli/numbers.h"
#include "cli/platform/system.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

constexpr auto kPollInterval = std::chrono::milliseconds(50);

struct Arguments {
  FitFlags flags;
  SeriesFlags series;
  std::string dataset, out, report, start_from;
  std::optional<int64_t> budget;
  int64_t downscale = 1;
};

/// "name   summary" of all strategies, then of the parts; under each what can be set of it.
void printStrategies() {
  const auto print = [](const char* title, auto count, auto info) {
    std::printf("%s\n", title);
    uint64_t entries = 0;
    check(count(&entries));
    for (uint64_t i = 0; i < entries; ++i) {
      auto entry = sized<StippleStrategyInfo>();
      check(info(i, &entry));
      const bool is_field = entry.model == STIPPLE_FIT_FIELD;
      std::printf("  %-24s %s%s\n", entry.name_utf8, entry.summary_utf8,
                  is_field ? " (--model field)" : "");
      for (uint64_t k = 0; k < entry.setting_count; ++k) {
        auto setting = sized<StippleStrategySetting>();
        check(stipple_strategy_setting(entry.name_utf8, k, &setting));
        std::printf("      %-20s %g, of %g to %g\n", setting.name_utf8, setting.default_value,
                    setting.minimum, setting.maximum);
      }
    }
  };
  print("strategies", stipple_strategy_count, stipple_strategy_info);
  print("parts, after a strategy and +", stipple_strategy_part_count, stipple_strategy_part_info);
  throw CLI::Success();
}

/// "Joint  1200 / 2000  loss 0.0312  PSNR 23.41 dB  14700 splats  1:23 left"
std::string lineOf(const StippleFitFigures& figures) {
  char text[200];
  std::string line = figures.stage;
  if (figures.iteration == 0) return line;
  std::snprintf(text, sizeof(text), "  %llu / %llu  loss %.4f",
                static_cast<unsigned long long>(figures.iteration),
                static_cast<unsigned long long>(figures.iterations), figures.loss);
  line += text;
  if (std::isfinite(figures.psnr)) {
    std::snprintf(text, sizeof(text), "  PSNR %.2f dB", figures.psnr);
    line += text;
  }
  line += "  " + std::to_string(figures.splat_count) + " splats  " +
          timeText(figures.seconds_left) + " left";
  return line;
}

void printNotes(const Job& job, uint64_t& printed, uint64_t count) {
  for (; printed < count; ++printed) {
    const char* text = nullptr;
    check(stipple_fit_note(job.get(), printed, &text));
    std::fprintf(stderr, "stipple: note: %s\n", text);
  }
}

/// Waits for the end. Ctrl-C, SIGTERM and SIGHUP end the fit with its best. Returns: whether all
/// steps were taken. Errors: Interrupted where none was.
bool watch(const Job& job) {
  StatusLine line;
  auto progress = sized<StippleJobProgress>();
  auto figures = sized<StippleFitFigures>();
  uint64_t printed = 0;
  for (;;) {
    check(stipple_job_poll(job.get(), &progress));
    check(stipple_fit_figures(job.get(), &figures));
    if (figures.note_count > printed) line.clear();
    printNotes(job, printed, figures.note_count);
    if (progress.state != STIPPLE_JOB_RUNNING) break;
    if (notedSignal() != 0) check(stipple_job_cancel(job.get()));
    const double done = figures.iterations == 0 ? 0
                                                : static_cast<double>(figures.iteration) /
                                                      static_cast<double>(figures.iterations);
    line.show(done, figures.stage, lineOf(figures));
    std::this_thread::sleep_for(kPollInterval);
  }
  line.clear();
  const StippleStatus status = stipple_job_wait(job.get());
  if (status == STIPPLE_ERROR_CANCELLED) {
    if (figures.iteration > 0) return false;
    throw Interrupted(notedSignal());
  }
  check(status);
  return true;
}

/// What becomes of a fit that has ended.
struct Result {
  std::string out;
  uint64_t budget;  ///< 0: the largest
  uint32_t model;   ///< StippleFitModel
  uint64_t seed;
};

void save(const Context& context, const Job& job, const Result& result) {
  const bool is_asset = !hasSplatExtension(result.out);
  if (result.model != STIPPLE_FIT_EXPLICIT && is_asset) {
    const auto model = make<Model>(stipple_fit_model, job.get());
    check(stipple_model_save(model.get(), result.out.c_str()));
    return;
  }
  auto cloud = make<Cloud>(stipple_fit_cloud, job.get(), result.budget);
  auto info = sized<StippleCloudInfo>();
  check(stipple_cloud_info(cloud.get(), &info));
  const bool is_cut = result.budget > 0 && result.budget < info.count;
  const bool is_of_anchors = result.model == STIPPLE_FIT_FIELD ||
                             result.model == STIPPLE_FIT_SCAFFOLD ||
                             result.model == STIPPLE_FIT_RELAY;
  if (!is_of_anchors && (is_asset || is_cut)) {
    const Model tree = hierarchyOf(context, cloud, result.seed);
    if (is_asset) {
      check(stipple_model_save(tree.get(), result.out.c_str()));
      return;
    }
    cloud = cutOf(tree, result.budget);
  }
  check(stipple_cloud_save(cloud.get(), result.out.c_str(), nullptr));
}

/// Told before hours of work, not after them.
void requireFolder(const std::string& path) {
  const std::filesystem::path parent = std::filesystem::path(path).parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  if (!std::filesystem::is_directory(folder)) {
    throw Failure("'" + path + "' cannot be written: there is no folder '" + folder + "'");
  }
  if (!isWritable(folder)) {
    throw Failure("'" + path + "' cannot be written: the folder '" + folder + "' is read-only");
  }
}

/// A result that cannot be written where it was wanted (a full disk) goes where temporary files go.
void saveSomewhere(const Context& context, const Job& job, const Result& result) {
  try {
    save(context, job, result);
  } catch (const Failure& failure) {
    Result elsewhere = result;
    std::filesystem::path folder;
    try {
      folder = newTemporaryFolder();
      elsewhere.out = (folder / std::filesystem::path(result.out).filename()).string();
      save(context, job, elsewhere);
    } catch (const std::exception&) {
      std::error_code ignored;
      if (!folder.empty()) std::filesystem::remove_all(folder, ignored);
      throw failure;
    }
    throw Failure(std::string(failure.what()) + "; the result is in '" + elsewhere.out + "'");
  }
}

void requirePlaces(const Arguments& arguments, const std::string& checkpoint, bool resumes) {
  if (!hasSplatExtension(arguments.out) && fileKind(arguments.out) != FileKind::kModel) {
    throw Failure("'" + arguments.out + "' is not a splat file; " + splatExtensions(true) +
                  " or .stipple.safetensors is expected");
  }
  requireFolder(arguments.out);
  const bool is_left = std::filesystem::exists(checkpoint);
  if (is_left && !resumes) {
    throw Failure("'" + checkpoint +
                  "' is left from a fit that was stopped; go on with --resume, or remove it");
  }
  if (!is_left && resumes) {
    throw Failure("--resume needs '" + checkpoint + "', which is not there");
  }
  // What goes on reads its checkpoint, and says more of one that is damaged.
  check(stipple_fit_places_check(arguments.report.empty() ? nullptr : arguments.report.c_str(),
                                 resumes ? nullptr : checkpoint.c_str()));
}

void printFigures(const Job& job) {
  auto figures = sized<StippleFitFigures>();
  check(stipple_fit_figures(job.get(), &figures));
  Report report;
  report.add("iterations", figures.iteration);
  report.add("best_iteration", figures.best_iteration);
  report.add(figures.measured_on_training ? "training_psnr" : "held_out_psnr", figures.best_psnr);
  if (std::isfinite(figures.best_moving_psnr)) {
    report.add(figures.measured_on_training ? "training_moving_psnr" : "held_out_moving_psnr",
               figures.best_moving_psnr);
  }
  report.add("gaussians", figures.splat_count);
  report.add("seconds", figures.seconds);
  report.print(false);
}

/// Of a fit of key frames; what else lies in their folder stays, and the folder then, too.
void removeKeyFrames(const std::string& folder) {
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none)) {
    std::error_code ignored;
    if (entry.path().extension() == ".safetensors") std::filesystem::remove(entry.path(), ignored);
  }
  std::filesystem::remove(folder, none);
}

Job started(const Context& context, const Arguments& arguments, const Views& views,
            const StippleFitOptions& options) {
  const auto* seen = const_cast<const StippleViews*>(views.get());
  if (arguments.start_from.empty()) {
    return make<Job>(stipple_fit_start, context.get(), seen, &options);
  }
  const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments.start_from.c_str());
  return make<Job>(stipple_fit_start_from, context.get(),
                   const_cast<const StippleCloud*>(cloud.get()), seen, &options);
}

void fit(const Context& context, const Arguments& arguments) {
  const std::string checkpoint = arguments.out + ".checkpoint.safetensors";
  const StippleFitOptions options = arguments.flags.options(checkpoint);
  requirePlaces(arguments, checkpoint, options.resume != 0);
  const uint64_t budget = arguments.budget ? counted(*arguments.budget, "--budget") : 0;
  if (arguments.series.holdsOut() && options.holdout == 0) {
    throw Failure("--held-out-cameras and --holdout 0 say both what is held out");
  }
  const Views views =
      openViews(context, arguments.dataset, arguments.downscale, &arguments.series,
                options.model == STIPPLE_FIT_MOTION || options.model == STIPPLE_FIT_RELAY);
  printSeries(views);
  // From here on there is something to keep, also where a terminal or the other end of a pipe is
  // gone.
  const SignalHold hold;
  ignoreClosedPipes();
  const Job job = started(context, arguments, views, options);
  const bool is_whole = watch(job);
  saveSomewhere(context, job, {arguments.out, budget, options.model, options.seed});
  if (!arguments.report.empty()) {
    check(stipple_fit_report_save(job.get(), arguments.report.c_str()));
  }
  if (is_whole) {
    std::filesystem::remove(checkpoint);
    removeKeyFrames(checkpoint + ".frames");
  } else {
    std::fprintf(stderr, "stipple: stopped; the best so far is in '%s', --resume goes on\n",
                 arguments.out.c_str());
  }
  printFigures(job);
}

}  // namespace

void addFit(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  Arguments& to = *arguments;
  CLI::App* command = app.add_subcommand("fit", "Fits splats to images with cameras.");
  command
      ->add_option("dataset", to.dataset,
                   "A COLMAP folder, transforms.json or its folder, or a folder with "
                   "poses_bounds.npy, with the images.")
      ->required();
  command->add_option("out", to.out, "Splats (.ply and others), or a model (.stipple.safetensors).")
      ->required();
  to.flags.addTo(*command);
  to.series.addTo(*command);
  command->add_option("--start-from", to.start_from,
                      "The fit begins with these splats, and not with its own: the result of "
                      "'stipple detail', of another fit or of a cut. In the coordinates of the "
                      "data set.");
  // While the command line is read: newer releases of CLI11 ask for missing arguments before they
  // call back.
  command->add_flag_callback("--strategies", printStrategies, "Print all strategies and parts.")
      ->trigger_on_parse();
  command->add_option("--downscale", to.downscale, "Images are made smaller by this factor.")
      ->capture_default_str();
  command->add_option("--budget", to.budget,
                      "This number of splats (of a field, anchors) goes into a splat file.");
  command->add_option("--report", to.report,
                      "The story of the fit goes here as JSON, and its curves beside it as .svg.");
  command->callback([arguments, &context] { fit(context, *arguments); });
}

}  // namespace stipple::cli
