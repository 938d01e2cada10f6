#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <vector>

#include "cli/camera_options.h"
#include "cli/commands.h"
#include "cli/placed_clouds.h"
#include "cli/report.h"
#include "cli/voxels.h"

namespace stipple::cli {

namespace {

using AccuracyReport = Handle<StippleAccuracyReport, stipple_accuracy_report_free>;

struct Arguments {
  std::vector<std::string> in, out;
  std::string fit;
  CameraArguments camera;
  std::optional<double> voxel_size;
  std::optional<int64_t> resolution;
  std::optional<uint32_t> repetitions;
  std::optional<uint64_t> reference_pixels;
  std::optional<double> seconds, within, above;
};

bool isVolume(const Arguments& arguments) {
  return arguments.voxel_size || arguments.resolution;
}

/// What is measured is said by the options; each says what else it needs.
void requireSubject(const Arguments& arguments) {
  const bool is_fit = !arguments.fit.empty();
  if (is_fit && (isVolume(arguments) || !arguments.in.empty() || !arguments.camera.path.empty())) {
    throw Failure("--fit reads the report of a fit; it takes no splats, camera or voxels");
  }
  if (is_fit) return;
  if (arguments.in.empty()) throw Failure("nothing to measure; splats or --fit REPORT is needed");
  if (isVolume(arguments) && (!arguments.camera.path.empty() || arguments.reference_pixels)) {
    throw Failure("--voxel-size and --resolution measure a volume; --camera measures a view");
  }
  if (!isVolume(arguments) && arguments.camera.path.empty()) {
    throw Failure("--camera is needed to measure a view, --voxel-size or --resolution a volume");
  }
}

StippleAccuracyMeasureOptions optionsOf(const Arguments& arguments) {
  StippleAccuracyMeasureOptions options;
  stipple_accuracy_measure_options_init(&options);
  if (arguments.repetitions) options.repetitions = *arguments.repetitions;
  if (arguments.reference_pixels) options.reference_pixels = *arguments.reference_pixels;
  if (arguments.seconds) options.max_seconds = *arguments.seconds;
  return options;
}

StippleAccuracyRow rowOf(const AccuracyReport& report, uint64_t index) {
  auto row = sized<StippleAccuracyRow>();
  check(stipple_accuracy_report_row(report.get(), index, &row));
  return row;
}

/// A star marks what is best for its time; an e times that were not measured whole.
void printTable(const AccuracyReport& report, uint64_t count, bool is_volume) {
  std::printf("%-42s %10s %17s %8s %8s %8s %10s  %s\n", "setting", "ms", "quartiles", "PSNR",
              "largest", "99.9 %", is_volume ? "voxels" : "splats", "looks");
  for (uint64_t i = 0; i < count; ++i) {
    const StippleAccuracyRow row = rowOf(report, i);
    char quartiles[32] = "";
    if (row.repetitions > 1) {
      std::snprintf(quartiles, sizeof(quartiles), "%.4g-%.4g", row.seconds_low * 1e3,
                    row.seconds_high * 1e3);
    }
    char psnr[32] = "exact";
    if (std::isfinite(row.psnr)) std::snprintf(psnr, sizeof(psnr), "%.2f", row.psnr);
    std::printf("%-42s %9.4g%s %17s %8s %8.4g %8.4g %10llu  %s%s\n", row.name_utf8,
                row.seconds * 1e3, row.is_estimated ? "e" : " ", quartiles, psnr,
                row.largest_error, row.error_99_9, static_cast<unsigned long long>(row.splat_count),
                row.verdict_utf8, row.is_on_front ? " *" : "");
  }
}

AccuracyReport measuredView(const Context& context, const Arguments& arguments) {
  const StippleCamera camera = cameraOf(context, arguments.camera);
  const PlacedClouds clouds(context, arguments.in);
  const StippleAccuracyMeasureOptions options = optionsOf(arguments);
  const auto job =
      make<Job>(stipple_accuracy_measure_start, context.get(), clouds.instances(), clouds.count(),
                &camera, static_cast<const StippleRenderOptions*>(nullptr), &options);
  finish(job);
  return make<AccuracyReport>(stipple_job_accuracy_report,
                              const_cast<const StippleJob*>(job.get()));
}

AccuracyReport measuredVolume(const Context& context, const Arguments& arguments) {
  const auto finest =
      voxelizeOptions(arguments.voxel_size.value_or(0), arguments.resolution.value_or(256));
  const PlacedClouds clouds(context, arguments.in);
  StippleVolumeAccuracyOptions options;
  stipple_volume_accuracy_options_init(&options);
  if (arguments.repetitions) options.repetitions = *arguments.repetitions;
  if (arguments.seconds) options.max_seconds = *arguments.seconds;
  const auto job =
      make<Job>(stipple_volume_accuracy_start, context.get(), clouds.instances(), clouds.count(),
                &finest, const_cast<const StippleVolumeAccuracyOptions*>(&options));
  finish(job);
  return make<AccuracyReport>(stipple_job_accuracy_report,
                              const_cast<const StippleJob*>(job.get()));
}

AccuracyReport reportOf(const Context& context, const Arguments& arguments) {
  if (!arguments.fit.empty()) {
    return make<AccuracyReport>(stipple_fit_accuracy_report, arguments.fit.c_str());
  }
  return isVolume(arguments) ? measuredVolume(context, arguments)
                             : measuredView(context, arguments);
}

void printHead(const StippleAccuracyReportInfo& info) {
  const auto splats = static_cast<unsigned long long>(info.splat_count);
  if (info.subject == STIPPLE_ACCURACY_OF_IMAGE) {
    std::printf(
        "%u x %u pixels, %llu of them compared with the reference itself, %llu splats, "
        "%u threads\n",
        info.width, info.height, static_cast<unsigned long long>(info.compared_pixels), splats,
        info.thread_count);
  } else if (info.subject == STIPPLE_ACCURACY_OF_VOLUME) {
    std::printf("%llu pixels of three sides compared, %llu splats, %u threads\n",
                static_cast<unsigned long long>(info.compared_pixels), splats, info.thread_count);
  } else {
    std::printf("a fit of %llu splats, PSNR on the views that it measured\n", splats);
  }
}

void measure(const Context& context, const Arguments& arguments) {
  requireSubject(arguments);
  const AccuracyReport report = reportOf(context, arguments);
  auto info = sized<StippleAccuracyReportInfo>();
  check(stipple_accuracy_report_info(report.get(), &info));
  for (const std::string& path : arguments.out) {
    check(stipple_accuracy_report_save(report.get(), path.c_str()));
  }
  printHead(info);
  printTable(report, info.row_count, info.subject == STIPPLE_ACCURACY_OF_VOLUME);
  uint64_t index = 0;
  if (arguments.within) {
    check(stipple_accuracy_report_best_within(report.get(), *arguments.within / 1e3, &index));
    std::printf("best within %g ms: %s\n", *arguments.within, rowOf(report, index).name_utf8);
  }
  if (arguments.above) {
    check(stipple_accuracy_report_cheapest_above(report.get(), *arguments.above, &index));
    std::printf("cheapest above %g dB: %s\n", *arguments.above, rowOf(report, index).name_utf8);
  }
}

}  // namespace

void addAccuracy(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "accuracy", "What each setting of accuracy costs in time, for a view, a volume or a fit");
  command->add_option("in", arguments->in, "Splat files, measured together");
  addCameraOptions(*command, arguments->camera);
  command->get_option("--camera")->required(false);
  auto* size = command->add_option("--voxel-size", arguments->voxel_size,
                                   "Measure volumes instead; metres of the finest");
  command
      ->add_option("--resolution", arguments->resolution,
                   "The same; the finest has so many voxels along the longest side")
      ->excludes(size);
  command->add_option("--fit", arguments->fit,
                      "Instead, what iterations brought: of the report that 'fit --report' wrote");
  command->add_option("-o,--out", arguments->out, "Reports: .json, .csv, .svg")->required();
  command->add_option("--repetitions", arguments->repetitions,
                      "Timings of each setting, alternately; default 7, for volumes 5");
  command->add_option(
      "--reference-pixels", arguments->reference_pixels,
      "Pixels that are compared with the reference, spread over the image; 0: all; default 65536");
  command->add_option("--seconds", arguments->seconds,
                      "Seconds after which no further round begins; default 60");
  command->add_option("--within", arguments->within,
                      "Milliseconds: say the best setting that needs no more");
  command->add_option("--above", arguments->above, "dB: say the cheapest setting that reaches it");
  command->callback([arguments, &context] { measure(context, *arguments); });
}

}  // namespace stipple::cli
