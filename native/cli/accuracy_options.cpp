#include "cli/accuracy_options.h"

#include "cli/library.h"

namespace stipple::cli {

namespace {

uint32_t levelOf(const std::string& name) {
  if (name == "draft") return STIPPLE_ACCURACY_DRAFT;
  if (name == "preview") return STIPPLE_ACCURACY_PREVIEW;
  if (name == "reference") return STIPPLE_ACCURACY_REFERENCE;
  return STIPPLE_ACCURACY_FINAL;
}

}  // namespace

void addAccuracyOptions(CLI::App& command, AccuracyArguments& arguments) {
  command
      .add_option("--accuracy", arguments.level,
                  "draft; preview; final; rays (final with exact projection and order); double "
                  "(final in double precision); reference (rays without any limit)")
      ->check(CLI::IsMember({"draft", "preview", "final", "rays", "double", "reference"}))
      ->capture_default_str();
  command
      .add_option("--order", arguments.order,
                  "Of splats: by their centres, or exact at each pixel; default: of the accuracy")
      ->check(CLI::IsMember({"centre", "pixel"}));
  command
      .add_option("--projection", arguments.projection,
                  "Ellipses, or what each pixel's ray meets; default: of the accuracy")
      ->check(CLI::IsMember({"affine", "ray"}));
  command
      .add_option("--antialiasing", arguments.antialiasing,
                  "as-trained; mip; samples (see --samples)")
      ->check(CLI::IsMember({"as-trained", "mip", "samples"}));
  command.add_option("--samples", arguments.samples,
                     "Averages the image at this many times the size, 1 to 16");
  command.add_option("--degree", arguments.degree, "Harmonics above are left out, 0 to 4");
  command.add_option("--precision", arguments.precision, "Default: of the accuracy")
      ->check(CLI::IsMember({"float", "double"}));
  command.add_option("--min-alpha,--least-alpha", arguments.min_alpha,
                     "Fainter splats are skipped at a pixel, above 0 and below 1");
  command.add_option("--share", arguments.share,
                     "Of the splats, above 0 to 1: they are merged into so many");
}

StippleAccuracy accuracyOf(const AccuracyArguments& arguments) {
  StippleAccuracy accuracy;
  check(stipple_accuracy_init(levelOf(arguments.level), &accuracy));
  if (arguments.level == "rays") {
    accuracy.order = STIPPLE_ORDER_PIXEL;
    accuracy.projection = STIPPLE_PROJECTION_RAY;
  }
  if (arguments.level == "double") accuracy.precision = STIPPLE_PRECISION_DOUBLE;
  if (!arguments.order.empty()) {
    accuracy.order = arguments.order == "pixel" ? STIPPLE_ORDER_PIXEL : STIPPLE_ORDER_CENTRE;
  }
  if (!arguments.projection.empty()) {
    accuracy.projection =
        arguments.projection == "ray" ? STIPPLE_PROJECTION_RAY : STIPPLE_PROJECTION_AFFINE;
  }
  if (!arguments.precision.empty()) {
    accuracy.precision =
        arguments.precision == "double" ? STIPPLE_PRECISION_DOUBLE : STIPPLE_PRECISION_FLOAT;
  }
  if (arguments.samples) {
    accuracy.samples_per_side = *arguments.samples;
    accuracy.antialiasing = STIPPLE_SAMPLING_SAMPLES;
  }
  if (arguments.antialiasing == "as-trained") accuracy.antialiasing = STIPPLE_SAMPLING_AS_TRAINED;
  if (arguments.antialiasing == "mip") accuracy.antialiasing = STIPPLE_SAMPLING_MIP;
  if (arguments.antialiasing == "samples") accuracy.antialiasing = STIPPLE_SAMPLING_SAMPLES;
  if (arguments.degree) accuracy.sh_degree_limit = *arguments.degree;
  if (arguments.min_alpha) accuracy.min_alpha = *arguments.min_alpha;
  if (arguments.share) accuracy.budget_share = *arguments.share;
  check(stipple_accuracy_check(&accuracy));
  return accuracy;
}

}  // namespace stipple::cli
