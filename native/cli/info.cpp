#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

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
  auto settings = sized<StippleModelSettings>();
  check(stipple_model_settings(model.get(), &settings));
  Report report;
  report.add("kind", info.kind_label);
  if (settings.budget_unit == STIPPLE_BUDGET_SPLATS) report.add("count", info.leaf_count);
  // Where anchors are drawn there may be any number.
  const bool has_anchors = settings.budget_unit == STIPPLE_BUDGET_ANCHORS &&
                           settings.maximum_budget < STIPPLE_MAX_ANCHORS;
  if (has_anchors) report.add("anchors", settings.maximum_budget);
  if (settings.maximum_learned_budget != 0) {
    report.add("least_anchors", settings.minimum_learned_budget);
    report.add("most_anchors", settings.maximum_learned_budget);
  }
  if (settings.minimum_gaussians_per_anchor > 1) {
    report.add("gaussians_per_anchor", uint64_t{settings.default_gaussians_per_anchor});
  }
  report.add("harmonic_degree", uint64_t{info.sh_degree});
  if (info.leaf_level != 0) {
    report.add("leaf_level", uint64_t{info.leaf_level});
    report.add("leaves", info.leaf_count);
  }
  if (info.sample_count != 0) report.add("surface_samples", info.sample_count);
  if (settings.has_time) {
    report.add("time_begin", settings.time_begin);
    report.add("time_end", settings.time_end);
  }
  report.add("bounds_min", info.bounds_min);
  report.add("bounds_max", info.bounds_max);
  return report;
}

/// What most of a data set's views share, in the order in which it is first met: "800 x 600: 20".
class Tally {
 public:
  void count(const std::string& what) {
    for (auto& [name, number] : counts_) {
      if (name == what) {
        ++number;
        return;
      }
    }
    counts_.emplace_back(what, 1);
  }
  std::string text() const {
    // A data set of phones may have a size for every picture.
    constexpr size_t kMostNames = 8;
    std::string text;
    for (size_t i = 0; i < std::min(counts_.size(), kMostNames); ++i) {
      text += (i > 0 ? ", " : "") + counts_[i].first;
      if (counts_.size() > 1) text += " (" + std::to_string(counts_[i].second) + ")";
    }
    if (counts_.size() > kMostNames) {
      text += " and " + std::to_string(counts_.size() - kMostNames) + " more";
    }
    return text;
  }

 private:
  std::vector<std::pair<std::string, size_t>> counts_;
};

std::string sizeText(uint32_t width, uint32_t height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

Report describeDataset(const Views& views) {
  auto info = sized<StippleViewsInfo>();
  check(stipple_views_info(views.get(), &info));
  Tally models, file_sizes, sizes;
  uint64_t distorted = 0, splits[4] = {};
  for (uint64_t i = 0; i < info.view_count; ++i) {
    auto view = sized<StippleViewInfo>();
    auto camera = sized<StippleCamera>();
    check(stipple_views_view_info(views.get(), i, &view));
    check(stipple_views_camera(views.get(), i, &camera));
    models.count(view.camera_model);
    file_sizes.count(sizeText(view.source_width, view.source_height));
    sizes.count(sizeText(camera.width, camera.height));
    distorted += view.is_distorted;
    if (view.split < 4) ++splits[view.split];
  }
  Report report;
  report.add("kind", "data set");
  report.add("count", info.view_count);
  report.add("camera_models", models.text());
  report.add("sizes", file_sizes.text());
  if (distorted > 0) {
    report.add("distorted", distorted);
    report.add("sizes_without_distortion", sizes.text());
  }
  if (splits[STIPPLE_VIEW_SPLIT_NONE] < info.view_count) {
    report.add("train", splits[STIPPLE_VIEW_SPLIT_TRAIN]);
    report.add("test", splits[STIPPLE_VIEW_SPLIT_TEST]);
    report.add("validation", splits[STIPPLE_VIEW_SPLIT_VALIDATION]);
  }
  if (info.camera_count > 0) report.add("cameras", info.camera_count);
  if (info.frame_count > 1) {
    report.add("frames", info.frame_count);
    report.add("time_begin", info.time_begin);
    report.add("time_end", info.time_end);
  }
  report.add("points", info.point_count);
  report.add("colour_space", info.colour_space == STIPPLE_COLOUR_DISPLAY ? "srgb_rec709_display"
                                                                         : "lin_rec709_display");
  return report;
}

/// Cameras with pictures are a data set; where pictures are missing, the cameras and why.
Report describeViews(const Context& context, const std::string& path) {
  StippleViews* opened = nullptr;
  StippleViewsOpenOptions options;
  stipple_views_open_options_init(&options);
  options.with_frames = 1;
  const StippleStatus status = stipple_views_open(context.get(), path.c_str(), &options, &opened);
  if (status == STIPPLE_OK) return describeDataset(Views(opened));
  const std::string reason = stipple_last_error_message();
  StippleViews* loaded = nullptr;
  // Of two faults the first is told: without pictures it does not matter that lenses are distorted.
  if (stipple_views_load(context.get(), path.c_str(), &loaded) != STIPPLE_OK) throw Failure(reason);
  const Views views(loaded);
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
  report.add("pictures", "none: " + reason);
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
  command
      ->add_option("file", arguments->path,
                   "Splats, mesh, model, cameras, a data set's folder, volume or image")
      ->required();
  command->add_flag("--json", arguments->json, "Print one JSON object");
  command->callback(
      [arguments, &context] { describe(context, arguments->path).print(arguments->json); });
}

}  // namespace stipple::cli
