#include <memory>

#include "cli/commands.h"
#include "cli/formats.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

Report describeSplats(const Context& context, const std::string& path) {
  const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), path.c_str());
  auto info = sized<StippleCloudInfo>();
  check(stipple_cloud_info(cloud.get(), &info));
  Report report;
  report.add("kind", "splats");
  report.add("count", info.count);
  report.add("harmonic_degree", uint64_t{info.sh_degree});
  report.add("colour_space", info.colour_space == STIPPLE_COLOUR_DISPLAY ? "srgb_rec709_display"
                                                                         : "lin_rec709_display");
  report.add("antialias", info.antialias == STIPPLE_ANTIALIAS_MIP ? "mip" : "classic");
  report.add("frame", info.frame == STIPPLE_FRAME_UNKNOWN
                          ? "unknown (counts as RDF where a format demands a frame)"
                          : frameName(info.frame));
  report.add("bounds_min", info.bounds_min);
  report.add("bounds_max", info.bounds_max);
  return report;
}

Report describeMesh(const Context& context, const std::string& path) {
  const auto mesh = make<Mesh>(stipple_mesh_load, context.get(), path.c_str());
  auto info = sized<StippleMeshInfo>();
  check(stipple_mesh_info(mesh.get(), &info));
  Report report;
  report.add("kind", "mesh");
  report.add("vertices", info.vertex_count);
  report.add("triangles", info.triangle_count);
  report.add("materials", uint64_t{info.material_count});
  report.add("bounds_min", info.bounds_min);
  report.add("bounds_max", info.bounds_max);
  return report;
}

Report describeModel(const Context& context, const std::string& path) {
  const auto model = make<Model>(stipple_model_load, context.get(), path.c_str());
  auto info = sized<StippleModelInfo>();
  check(stipple_model_info(model.get(), &info));
  Report report;
  if (info.kind == STIPPLE_MODEL_HIERARCHY) {
    report.add("kind", "hierarchy of splats");
    report.add("count", info.leaf_count);
    report.add("harmonic_degree", uint64_t{info.sh_degree});
    report.add("bounds_min", info.bounds_min);
    report.add("bounds_max", info.bounds_max);
    return report;
  }
  report.add("kind", "surface model");
  report.add("leaf_level", uint64_t{info.leaf_level});
  report.add("leaves", info.leaf_count);
  report.add("surface_samples", info.sample_count);
  report.add("bounds_min", info.bounds_min);
  report.add("bounds_max", info.bounds_max);
  return report;
}

Report describeViews(const Context& context, const std::string& path) {
  const auto views = make<Views>(stipple_views_load, context.get(), path.c_str());
  uint64_t count = 0;
  check(stipple_views_count(views.get(), &count));
  Report report;
  report.add("kind", "cameras");
  report.add("count", count);
  if (count > 0) {
    auto camera = sized<StippleCamera>();
    check(stipple_views_camera(views.get(), 0, &camera));
    report.add("model",
               camera.model == STIPPLE_CAMERA_ORTHOGRAPHIC ? "orthographic" : "perspective");
    report.add("width", uint64_t{camera.width});
    report.add("height", uint64_t{camera.height});
  }
  return report;
}

Report describeVolume(const Context& context, const std::string& path) {
  const auto volume = make<Volume>(stipple_volume_load, context.get(), path.c_str());
  auto info = sized<StippleVolumeInfo>();
  check(stipple_volume_info(volume.get(), &info));
  Report report;
  report.add("kind", "volume");
  report.add("active_voxels", info.active_voxel_count);
  report.add("voxel_size", info.voxel_size);
  report.add("max_density", info.max_density);
  report.add("bounds_min", info.bounds_min);
  report.add("bounds_max", info.bounds_max);
  return report;
}

Report describeImage(const Context& context, const std::string& path) {
  const auto image = make<Image>(stipple_image_load, context.get(), path.c_str());
  auto info = sized<StippleImageInfo>();
  check(stipple_image_info(image.get(), &info));
  Report report;
  report.add("kind", "picture");
  report.add("width", uint64_t{info.width});
  report.add("height", uint64_t{info.height});
  report.add("channels", uint64_t{info.channels});
  report.add("transfer", info.transfer == STIPPLE_TRANSFER_SRGB ? "display sRGB" : "scene linear");
  return report;
}

Report describe(const Context& context, const std::string& path) {
  switch (fileKind(path)) {
    case FileKind::kSplats:
      return describeSplats(context, path);
    case FileKind::kMesh:
      return describeMesh(context, path);
    case FileKind::kModel:
      return describeModel(context, path);
    case FileKind::kViews:
      return describeViews(context, path);
    case FileKind::kVolume:
      return describeVolume(context, path);
    case FileKind::kImage:
      return describeImage(context, path);
  }
  throw Failure("unknown kind of file");
}

}  // namespace

void addInfo(CLI::App& app, const Context& context) {
  struct Arguments {
    std::string path;
    bool json = false;
  };
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("info", "What a file holds");
  command->add_option("file", arguments->path, "Splats, mesh, model, cameras, volume or picture")
      ->required();
  command->add_flag("--json", arguments->json, "Print one JSON object");
  command->callback(
      [arguments, &context] { describe(context, arguments->path).print(arguments->json); });
}

}  // namespace stipple::cli
