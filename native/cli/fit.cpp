#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include "cli/commands.h"
#include "cli/dataset.h"
#include "cli/formats.h"
#include "cli/hierarchy.h"
#include "cli/numbers.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

constexpr int kBarWidth = 24;
constexpr auto kPollInterval = std::chrono::milliseconds(50);

struct Arguments {
  std::string dataset, out, model = "explicit", quality = "balanced", background = "random", report,
                            shell = "auto";
  std::string strategy;
  std::optional<int64_t> gaussians, start, anchors, iterations, gaussians_per_anchor, sh_degree,
      budget;
  int64_t downscale = 1;
  int64_t holdout = 8;
  int64_t checkpoint_every = 0;
  uint64_t seed = 0;
  double picture_mib = 1024;
  double memory_mib = 0;
  bool resume = false, no_jitter = false, no_density_gradient = false;
};

/// Of one name in a list, its place.
uint32_t placeOf(const std::string& name, std::initializer_list<const char*> names) {
  uint32_t place = 0;
  for (const char* each : names) {
    if (name == each) return place;
    ++place;
  }
  throw Failure("'" + name + "' is not known");  // CLI11 has checked it
}

StippleFitOptions optionsOf(const Arguments& arguments, const std::string& checkpoint) {
  StippleFitOptions options;
  stipple_fit_options_init(&options);
  const uint32_t model = placeOf(arguments.model, {"explicit", "field"});
  check(stipple_fit_options_preset(&options, model,
                                   placeOf(arguments.quality, {"fast", "balanced", "fine"})));
  if (model == STIPPLE_FIT_EXPLICIT && (arguments.anchors || arguments.gaussians_per_anchor)) {
    throw Failure(
        "--anchors and --gaussians-per-anchor belong to --model field; explicit splats take "
        "--gaussians");
  }
  if (model == STIPPLE_FIT_FIELD && arguments.gaussians) {
    throw Failure("--gaussians belongs to --model explicit; a field takes --anchors");
  }
  if (model == STIPPLE_FIT_FIELD && arguments.start) {
    throw Failure("--start belongs to --model explicit; a field begins with its density");
  }
  if (arguments.no_density_gradient && !arguments.strategy.empty()) {
    throw Failure("--no-density-gradient and --strategy say both how a field's density is learned");
  }
  if (arguments.gaussians) options.max_splats = counted(*arguments.gaussians, "--gaussians");
  if (arguments.start) options.start_splats = counted(*arguments.start, "--start");
  if (arguments.anchors) {
    options.most_anchors = counted(*arguments.anchors, "--anchors");
    options.least_anchors = std::min(options.least_anchors, options.most_anchors);
  }
  if (arguments.gaussians_per_anchor) {
    options.gaussians_per_anchor =
        counted32(*arguments.gaussians_per_anchor, "--gaussians-per-anchor");
  }
  if (arguments.iterations) options.iterations = counted(*arguments.iterations, "--iterations");
  if (arguments.sh_degree) {
    options.sh_degree = counted32(*arguments.sh_degree, "--sh-degree", 0);
  }
  if (!arguments.strategy.empty()) options.strategy_utf8 = arguments.strategy.c_str();
  options.background = placeOf(arguments.background, {"black", "white", "random"});
  options.holdout = counted32(arguments.holdout, "--holdout", 0);
  options.jitter = !arguments.no_jitter;
  options.density_gradient = !arguments.no_density_gradient;
  options.shell = placeOf(arguments.shell, {"auto", "on", "off"});
  if (model == STIPPLE_FIT_EXPLICIT && options.shell != STIPPLE_FIT_SHELL_AUTO) {
    throw Failure("--shell belongs to --model field; explicit splats go as far as their points do");
  }
  options.seed = arguments.seed;
  options.picture_bytes = bytesOfMebibytes(arguments.picture_mib);
  options.max_bytes = bytesOfMebibytes(arguments.memory_mib);
  options.checkpoint_path_utf8 = checkpoint.c_str();
  options.checkpoint_interval = counted(arguments.checkpoint_every, "--checkpoint-every", 0);
  options.resume = arguments.resume;
  return options;
}

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

volatile std::sig_atomic_t g_interrupted = 0;

void interrupt(int) {
  g_interrupted = 1;
}

std::string timeText(double seconds) {
  const auto whole = static_cast<long>(std::max(0.0, seconds) + 0.5);
  char text[48];
  if (whole >= 3600) {
    std::snprintf(text, sizeof(text), "%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
  } else {
    std::snprintf(text, sizeof(text), "%ld:%02ld", whole / 60, whole % 60);
  }
  return text;
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

/// What the user sees of a fit that runs: a bar on a terminal, else now and then a line.
class Watch {
 public:
  void show(const StippleFitFigures& figures) {
    const double done = figures.iterations == 0 ? 0
                                                : static_cast<double>(figures.iteration) /
                                                      static_cast<double>(figures.iterations);
    if (is_terminal_) {
      const auto full = static_cast<size_t>(done * kBarWidth);
      std::fprintf(stderr, "\r[%s%s] %s\033[K", std::string(full, '#').c_str(),
                   std::string(kBarWidth - full, ' ').c_str(), lineOf(figures).c_str());
      std::fflush(stderr);
      is_drawn_ = true;
      return;
    }
    const int tenth = static_cast<int>(done * 10);
    if (tenth == tenth_ && stage_ == figures.stage) return;
    tenth_ = tenth;
    stage_ = figures.stage;
    std::fprintf(stderr, "%s\n", lineOf(figures).c_str());
  }
  void clear() {
    if (is_drawn_) std::fprintf(stderr, "\r\033[K");
    is_drawn_ = false;
  }

 private:
  bool is_terminal_ = isatty(STDERR_FILENO) != 0;
  bool is_drawn_ = false;
  int tenth_ = -1;
  std::string stage_;
};

void printNotes(const Job& job, uint64_t& printed, uint64_t count) {
  for (; printed < count; ++printed) {
    const char* text = nullptr;
    check(stipple_fit_note(job.get(), printed, &text));
    std::fprintf(stderr, "stipple: note: %s\n", text);
  }
}

/// Waits for the end. Ctrl-C ends the fit with its best. Returns: whether all steps were taken.
bool watch(const Job& job) {
  Watch watch;
  auto progress = sized<StippleJobProgress>();
  auto figures = sized<StippleFitFigures>();
  uint64_t printed = 0;
  const auto previous = std::signal(SIGINT, interrupt);
  for (;;) {
    check(stipple_job_poll(job.get(), &progress));
    check(stipple_fit_figures(job.get(), &figures));
    if (figures.note_count > printed) watch.clear();
    printNotes(job, printed, figures.note_count);
    if (progress.state != STIPPLE_JOB_RUNNING) break;
    if (g_interrupted) check(stipple_job_cancel(job.get()));
    watch.show(figures);
    std::this_thread::sleep_for(kPollInterval);
  }
  std::signal(SIGINT, previous);
  watch.clear();
  const StippleStatus status = stipple_job_wait(job.get());
  if (status == STIPPLE_ERROR_CANCELLED && figures.iteration > 0) return false;
  check(status);
  return true;
}

void save(const Context& context, const Job& job, const Arguments& arguments, uint32_t model) {
  const bool is_asset = !hasSplatEnding(arguments.out);
  if (model == STIPPLE_FIT_FIELD && is_asset) {
    const auto field = make<Model>(stipple_fit_model, job.get());
    check(stipple_model_save(field.get(), arguments.out.c_str()));
    return;
  }
  const uint64_t budget = arguments.budget ? counted(*arguments.budget, "--budget") : 0;
  auto cloud = make<Cloud>(stipple_fit_cloud, job.get(), budget);
  auto info = sized<StippleCloudInfo>();
  check(stipple_cloud_info(cloud.get(), &info));
  if (model == STIPPLE_FIT_EXPLICIT && (is_asset || (budget > 0 && budget < info.count))) {
    const Model tree = hierarchyOf(context, cloud, arguments.seed);
    if (is_asset) {
      check(stipple_model_save(tree.get(), arguments.out.c_str()));
      return;
    }
    cloud = cutOf(tree, budget);
  }
  check(stipple_cloud_save(cloud.get(), arguments.out.c_str(), nullptr));
}

/// Told before hours of work, not after them.
void requireFolder(const std::string& path) {
  const std::filesystem::path parent = std::filesystem::path(path).parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  if (!std::filesystem::is_directory(folder)) {
    throw Failure("'" + path + "' cannot be written: there is no folder '" + folder + "'");
  }
  if (access(folder.c_str(), W_OK) != 0) {
    throw Failure("'" + path + "' cannot be written: the folder '" + folder + "' is read-only");
  }
}

/// A result that cannot be written where it was wanted (a full disk) goes where temporary files go.
void saveSomewhere(const Context& context, const Job& job, const Arguments& arguments,
                   uint32_t model) {
  try {
    save(context, job, arguments, model);
  } catch (const Failure& failure) {
    Arguments elsewhere = arguments;
    const std::string name = std::filesystem::path(arguments.out).filename().string();
    elsewhere.out = (std::filesystem::temp_directory_path() /
                     ("stipple-" + std::to_string(getpid()) + "-" + name))
                        .string();
    try {
      save(context, job, elsewhere, model);
    } catch (const Failure&) {
      throw failure;
    }
    throw Failure(std::string(failure.what()) + "; the result is in '" + elsewhere.out + "'");
  }
}

void fit(const Context& context, const Arguments& arguments) {
  const bool is_asset = !hasSplatEnding(arguments.out);
  if (is_asset && fileKind(arguments.out) != FileKind::kModel) {
    throw Failure("'" + arguments.out + "' is not a splat file; " + splatEndings(true) +
                  " or .stipple.safetensors is expected");
  }
  requireFolder(arguments.out);
  if (!arguments.report.empty()) requireFolder(arguments.report);
  const std::string checkpoint = arguments.out + ".checkpoint.safetensors";
  const bool is_left = std::filesystem::exists(checkpoint);
  if (is_left && !arguments.resume) {
    throw Failure("'" + checkpoint +
                  "' is left from a fit that was stopped; go on with --resume, or remove it");
  }
  if (!is_left && arguments.resume) {
    throw Failure("--resume needs '" + checkpoint + "', which is not there");
  }
  const StippleFitOptions options = optionsOf(arguments, checkpoint);
  const Views views = openViews(context, arguments.dataset, arguments.downscale);
  const auto job =
      make<Job>(stipple_fit_start, context.get(), const_cast<const StippleViews*>(views.get()),
                const_cast<const StippleFitOptions*>(&options));
  const bool is_whole = watch(job);
  saveSomewhere(context, job, arguments, options.model);
  if (!arguments.report.empty()) {
    check(stipple_fit_report_save(job.get(), arguments.report.c_str()));
  }
  if (is_whole) std::filesystem::remove(checkpoint);
  if (!is_whole) {
    std::fprintf(stderr, "stipple: stopped; the best so far is in '%s', --resume goes on\n",
                 arguments.out.c_str());
  }
  auto figures = sized<StippleFitFigures>();
  check(stipple_fit_figures(job.get(), &figures));
  Report report;
  report.add("iterations", figures.iteration);
  report.add("best_iteration", figures.best_iteration);
  report.add(figures.measured_on_training ? "training_psnr" : "held_out_psnr", figures.best_psnr);
  report.add("gaussians", figures.splat_count);
  report.add("seconds", figures.seconds);
  report.print(false);
}

}  // namespace

void addFit(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  Arguments& to = *arguments;
  CLI::App* command = app.add_subcommand("fit", "Splats from pictures with cameras");
  command
      ->add_option("dataset", to.dataset,
                   "COLMAP folder, or transforms.json or its folder, with the pictures")
      ->required();
  command->add_option("out", to.out, "Splats (.ply and others), or a model (.stipple.safetensors)")
      ->required();
  command->add_option("--model", to.model, "explicit, or field (a learned density)")
      ->check(CLI::IsMember({"explicit", "field"}))
      ->capture_default_str();
  command->add_option(
      "--strategy", to.strategy,
      "How splats are added and removed: name(setting=number)+part; see --strategies. Else as "
      "the quality has it");
  command->add_flag_callback("--strategies", printStrategies, "Print all strategies and parts");
  command->add_option("--quality", to.quality, "Sets iterations, counts and strategy")
      ->check(CLI::IsMember({"fast", "balanced", "fine"}))
      ->capture_default_str();
  auto* gaussians =
      command->add_option("--gaussians", to.gaussians, "Explicit: the most splats there may be");
  command->add_option("--start", to.start,
                      "Explicit: splats to begin with; without it as many as points are known");
  command->add_option("--anchors", to.anchors, "Field: the largest budget that is trained")
      ->excludes(gaussians);
  command->add_option("--gaussians-per-anchor", to.gaussians_per_anchor,
                      "Field: 4, the default, to 32");
  command->add_option("--iterations", to.iterations, "Steps, one view each");
  command->add_option("--sh-degree", to.sh_degree, "0 (colour without view) to 4");
  command->add_option("--downscale", to.downscale, "Pictures are made smaller by this factor")
      ->capture_default_str();
  command
      ->add_option("--holdout", to.holdout,
                   "Every so many-th picture is measured and not learned from; 0: none")
      ->capture_default_str();
  command->add_option("--background", to.background, "Behind transparent pictures")
      ->check(CLI::IsMember({"black", "white", "random"}))
      ->capture_default_str();
  command->add_option("--budget", to.budget, "Splats (field: anchors) that go into a splat file");
  command
      ->add_option("--picture-memory", to.picture_mib,
                   "MiB of pictures kept; others are read again whenever they are wanted")
      ->capture_default_str();
  command
      ->add_option("--memory", to.memory_mib,
                   "MiB of the whole fit, about: fewer splats and pictures are kept; 0: any number")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--report", to.report,
                      "JSON of the whole fit; curves go beside it with the ending .svg");
  command
      ->add_option("--checkpoint-every", to.checkpoint_every,
                   "Saves what --resume needs after so many steps, beside once a minute")
      ->capture_default_str();
  command->add_flag("--resume", to.resume, "Goes on from where the same command was stopped");
  command->add_flag("--no-jitter", to.no_jitter, "Field: anchors at the centres of their cells");
  command->add_flag("--no-density-gradient", to.no_density_gradient,
                    "Field: the density is not learned from the pictures");
  command
      ->add_option("--shell", to.shell,
                   "Field: a shell behind what is known, for what is far away; auto: where "
                   "pictures are opaque")
      ->check(CLI::IsMember({"auto", "on", "off"}))
      ->capture_default_str();
  command->add_option("--seed", to.seed)->capture_default_str();
  command->callback([arguments, &context] { fit(context, *arguments); });
}

}  // namespace stipple::cli
