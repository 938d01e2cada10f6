#include <chrono>
#include <memory>

#include "cli/commands.h"
#include "cli/report.h"
#include "cli/voxels.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::string in, out;
  double voxel_size = 0;
  int64_t resolution = 256;
};

void voxelize(const Context& context, const Arguments& arguments) {
  if (fileKind(arguments.out) != FileKind::kVolume) {
    throw Failure("'" + arguments.out + "' is not a volume; .vdb is expected");
  }
  const auto options = voxelizeOptions(arguments.voxel_size, arguments.resolution);
  const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments.in.c_str());
  const auto start = std::chrono::steady_clock::now();
  const Volume volume = voxelized(context, cloud, options);
  const double seconds = secondsSince(start);
  check(stipple_volume_save(volume.get(), arguments.out.c_str()));
  auto info = sized<StippleVolumeInfo>();
  check(stipple_volume_info(volume.get(), &info));
  Report report;
  report.add("active_voxels", info.active_voxel_count);
  report.add("voxel_size", info.voxel_size);
  report.add("max_density", info.max_density);
  report.add("seconds", seconds);
  report.print(false);
}

}  // namespace

void addVoxelize(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("voxelize", "Splats to an OpenVDB volume");
  command->add_option("in", arguments->in, "Splat file")->required();
  command->add_option("out", arguments->out, "Volume (.vdb)")->required();
  auto* size = command->add_option("--voxel-size", arguments->voxel_size, "Metres");
  command->add_option("--resolution", arguments->resolution, "Voxels along the longest side")
      ->capture_default_str()
      ->excludes(size);
  command->callback([arguments, &context] { voxelize(context, *arguments); });
}

}  // namespace stipple::cli
