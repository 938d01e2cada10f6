#include <memory>

#include "cli/commands.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

/// weights: a file with LPIPS's, empty for none.
Report compareImages(const Context& context, const std::string& a, const std::string& b,
                     const std::string& weights) {
  const auto first = make<Image>(stipple_image_load, context.get(), a.c_str());
  const auto second = make<Image>(stipple_image_load, context.get(), b.c_str());
  auto result = sized<StippleImageComparison>();
  check(stipple_image_compare(first.get(), second.get(), &result));
  Report report;
  report.add("psnr", result.psnr);
  report.add("ssim", result.ssim);
  report.add("max_error", result.max_error);
  report.add("mean_error", result.mean_error);
  if (!weights.empty()) {
    double distance = 0;
    const auto job =
        make<Job>(stipple_image_lpips_start, first.get(), second.get(), weights.c_str(), &distance);
    finish(job);
    report.add("lpips", distance);
  }
  return report;
}

Report compareClouds(const Context& context, const std::string& a, const std::string& b) {
  const auto first = make<Cloud>(stipple_cloud_load, context.get(), a.c_str());
  const auto second = make<Cloud>(stipple_cloud_load, context.get(), b.c_str());
  auto result = sized<StippleCloudComparison>();
  check(stipple_cloud_compare(first.get(), second.get(), &result));
  Report report;
  report.add("count_a", result.count_a);
  report.add("count_b", result.count_b);
  report.add("same_order", uint64_t{result.same_order});
  report.add("max_position", result.max_position);
  report.add("max_rotation", result.max_rotation);
  report.add("max_scale_ratio", result.max_scale_ratio);
  report.add("max_opacity", result.max_opacity);
  report.add("max_sh", result.max_sh);
  report.add("mean_position", result.mean_position);
  report.add("mean_rotation", result.mean_rotation);
  report.add("mean_scale_ratio", result.mean_scale_ratio);
  report.add("mean_opacity", result.mean_opacity);
  report.add("mean_sh", result.mean_sh);
  return report;
}

}  // namespace

void addCompare(CLI::App& app, const Context& context) {
  struct Arguments {
    std::string a, b, lpips;
    bool json = false;
  };
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "compare", "PSNR, SSIM and largest error of two images, or differences of two clouds");
  command->add_option("a", arguments->a, "Image or splat file")->required();
  command->add_option("b", arguments->b, "Image or splat file of the same kind")->required();
  command->add_option("--lpips", arguments->lpips,
                      "File with the weights of LPIPS, for images (docs/methods/lpips.md)");
  command->add_flag("--json", arguments->json, "Print one JSON object");
  command->callback([arguments, &context] {
    const FileKind kind = fileKind(arguments->a);
    if (kind != fileKind(arguments->b) || (kind != FileKind::kImage && kind != FileKind::kSplats)) {
      throw Failure("'" + arguments->a + "' and '" + arguments->b +
                    "' cannot be compared; two images or two splat files are expected");
    }
    if (kind != FileKind::kImage && !arguments->lpips.empty()) {
      throw Failure("--lpips compares images; '" + arguments->a + "' holds splats");
    }
    const Report report = kind == FileKind::kImage
                              ? compareImages(context, arguments->a, arguments->b, arguments->lpips)
                              : compareClouds(context, arguments->a, arguments->b);
    report.print(arguments->json);
  });
}

}  // namespace stipple::cli
