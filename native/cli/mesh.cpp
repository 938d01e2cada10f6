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
  int64_t resolution = 128;
  double threshold = 0.5;
  double adaptivity = 0;
  bool largest = false;
  bool json = false;
};

Volume volumeOf(const Context& context, const Arguments& arguments) {
  if (fileKind(arguments.in) == FileKind::kVolume) {
    return make<Volume>(stipple_volume_load, context.get(), arguments.in.c_str());
  }
  const auto options = voxelizeOptions(arguments.voxel_size, arguments.resolution);
  const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments.in.c_str());
  return voxelized(context, cloud, options);
}

void mesh(const Context& context, const Arguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  const Volume volume = volumeOf(context, arguments);
  StippleVolumeToMeshOptions options;
  stipple_volume_to_mesh_options_init(&options);
  options.opacity = arguments.threshold;
  options.adaptivity = arguments.adaptivity;
  options.largest_only = arguments.largest ? 1 : 0;
  const auto job =
      make<Job>(stipple_volume_to_mesh_start, const_cast<const StippleVolume*>(volume.get()),
                const_cast<const StippleVolumeToMeshOptions*>(&options));
  finish(job);
  const auto made = make<Mesh>(stipple_job_mesh, const_cast<const StippleJob*>(job.get()));
  const double seconds = secondsSince(start);
  check(stipple_mesh_save(made.get(), arguments.out.c_str()));
  auto info = sized<StippleMeshInfo>();
  check(stipple_mesh_info(made.get(), &info));
  auto topology = sized<StippleMeshTopology>();
  check(stipple_mesh_topology(made.get(), &topology));
  auto voxels = sized<StippleVolumeInfo>();
  check(stipple_volume_info(volume.get(), &voxels));
  Report report;
  report.add("vertices", info.vertex_count);
  report.add("triangles", info.triangle_count);
  report.add("pieces", topology.piece_count);
  report.add("open_edges", topology.open_edge_count);
  report.add("volume", topology.volume);
  report.add("voxel_size", voxels.voxel_size);
  report.add("seconds", seconds);
  report.print(arguments.json);
}

}  // namespace

void addMesh(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("mesh", "Splats to a closed mesh for shadows and collisions");
  command->add_option("in", arguments->in, "Splat file, or a volume (.vdb) of stipple voxelize")
      ->required();
  command->add_option("out", arguments->out, "Mesh (.ply, .glb)")->required();
  auto* size = command->add_option("--voxel-size", arguments->voxel_size, "Metres");
  command->add_option("--resolution", arguments->resolution, "Voxels along the longest side")
      ->capture_default_str()
      ->excludes(size);
  command
      ->add_option("--threshold", arguments->threshold,
                   "Opacity of one voxel at which the surface lies, between 0 and 1")
      ->capture_default_str();
  command
      ->add_option("--adaptivity", arguments->adaptivity,
                   "0 to 1: larger faces where the surface is flat")
      ->capture_default_str();
  command->add_flag("--largest", arguments->largest,
                    "Only the piece that encloses most, without hollows");
  command->add_flag("--json", arguments->json, "Figures as JSON");
  command->callback([arguments, &context] { mesh(context, *arguments); });
}

}  // namespace stipple::cli
