#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>

#include "cli/commands.h"
#include "cli/formats.h"
#include "cli/hierarchy.h"
#include "cli/motion/shapes.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

constexpr int64_t kMaxRefineSteps = 1'000'000;

struct Arguments {
  std::string in, out, posed, order = "systematic";
  std::optional<int64_t> anchors;  // the model's own where there are none
  std::optional<double> ratio;
  int64_t refine = 0;
  std::optional<double> refine_seconds;
  bool smooth = false;
  int64_t gaussians_per_anchor = 1;
  uint64_t seed = 0;
  uint64_t samples = 0;
  double detail_weight = 1.0;
  double time = 0.0;
};

/// A model, and the mesh that it is of, where it is of one.
struct Source {
  Model model;
  Mesh mesh;
};

Source sourceOf(const Context& context, const Arguments& arguments) {
  const FileKind kind = fileKind(arguments.in);
  if (kind == FileKind::kModel) {
    return {make<Model>(stipple_model_load, context.get(), arguments.in.c_str()), nullptr};
  }
  if (kind == FileKind::kSplats) {
    const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments.in.c_str());
    return {hierarchyOf(context, cloud, arguments.seed), nullptr};
  }
  if (kind != FileKind::kMesh) {
    throw Failure("'" + arguments.in +
                  "' is not a source of splats; a mesh, a splat file or .stipple.safetensors is "
                  "expected");
  }
  auto mesh = make<Mesh>(stipple_mesh_load, context.get(), arguments.in.c_str());
  StippleModelFromMeshOptions options;
  stipple_model_from_mesh_options_init(&options);
  options.detail_weight = arguments.detail_weight;
  options.sample_count = arguments.samples;
  options.seed = arguments.seed;
  const auto job = make<Job>(stipple_model_from_mesh_start, context.get(),
                             const_cast<const StippleMesh*>(mesh.get()),
                             const_cast<const StippleModelFromMeshOptions*>(&options));
  finish(job);
  return {make<Model>(stipple_job_model, job.get()), std::move(mesh)};
}

/// Negative counts must reach the message as they were typed, not wrapped around.
uint64_t counted(int64_t value, const char* name, int64_t last) {
  if (value < 1 || value > last) {
    throw Failure(std::string(name) + " is " + std::to_string(value) + "; 1 to " +
                  std::to_string(last) + " is allowed");
  }
  return static_cast<uint64_t>(value);
}

/// What can be said of the options before a long job begins.
void checkBudget(const Arguments& arguments) {
  if (arguments.anchors) counted(*arguments.anchors, "--anchors", STIPPLE_MAX_ANCHORS);
  if (arguments.ratio && !(*arguments.ratio > 0 && *arguments.ratio <= 1)) {
    throw Failure("--ratio is " + std::to_string(*arguments.ratio) +
                  "; above 0 and up to 1 is allowed");
  }
  if (arguments.refine != 0) counted(arguments.refine, "--refine", kMaxRefineSteps);
  if (arguments.refine_seconds && !(*arguments.refine_seconds > 0)) {
    throw Failure("--refine-seconds is " + std::to_string(*arguments.refine_seconds) +
                  "; above 0 is allowed");
  }
}

bool refines(const Arguments& arguments) {
  return arguments.refine != 0 || arguments.refine_seconds;
}

StippleModelSettings settingsOf(const Model& model) {
  auto settings = sized<StippleModelSettings>();
  check(stipple_model_settings(model.get(), &settings));
  return settings;
}

/// The budget as it was asked for: a count, or a share of an existing cloud; else what the model
/// has by itself.
uint64_t budgetOf(const Model& model, const Arguments& arguments) {
  if (arguments.anchors) return counted(*arguments.anchors, "--anchors", STIPPLE_MAX_ANCHORS);
  const StippleModelSettings settings = settingsOf(model);
  if (!arguments.ratio) return settings.default_budget;
  if (settings.budget_unit != STIPPLE_BUDGET_SPLATS) {
    throw Failure("--ratio is a share of existing splats; a mesh takes --anchors");
  }
  const double count = std::round(*arguments.ratio * static_cast<double>(settings.maximum_budget));
  return static_cast<uint64_t>(std::max(count, 1.0));
}

/// The splats of a budget fitted to pictures of the mesh, or of all existing splats.
Cloud refined(const Cloud& cloud, const Source& source, const Arguments& arguments) {
  const StippleModelSettings settings = settingsOf(source.model);
  const bool of_all = settings.budget_unit == STIPPLE_BUDGET_SPLATS;
  if (!of_all && !source.mesh) {
    throw Failure("--refine fits to existing splats or to a mesh file; '" + arguments.in +
                  "' holds neither");
  }
  StippleRefineOptions options;
  stipple_refine_options_init(&options);
  // Where only the time is given, as many steps as fit.
  const int64_t steps = arguments.refine != 0 ? arguments.refine : kMaxRefineSteps;
  options.iterations = static_cast<uint32_t>(counted(steps, "--refine", kMaxRefineSteps));
  options.seconds = arguments.refine_seconds.value_or(0);
  options.seed = arguments.seed;
  const auto* start = const_cast<const StippleCloud*>(cloud.get());
  const auto* given = const_cast<const StippleRefineOptions*>(&options);
  Job job;
  if (of_all) {
    const Cloud full = cutOf(source.model, settings.maximum_budget);
    job = make<Job>(stipple_cloud_refine_start, start, const_cast<const StippleCloud*>(full.get()),
                    given);
  } else {
    job = make<Job>(stipple_cloud_refine_to_mesh_start, start,
                    const_cast<const StippleMesh*>(source.mesh.get()), given);
  }
  finish(job);
  return make<Cloud>(stipple_job_cloud, job.get());
}

/// The splats as the posed mesh carries them that their asset brings at rest.
Cloud carried(const Context& context, const Cloud& cloud, const Arguments& arguments) {
  auto info = sized<StippleRestInfo>();
  check(stipple_asset_rest_info(context.get(), arguments.in.c_str(), &info));
  if (info.vertex_count == 0) {
    throw Failure(arguments.in +
                  " brings no mesh that its splats follow; 'stipple bind' gives it one");
  }
  Shape rest;
  rest.positions.resize(3 * info.vertex_count);
  rest.triangles.resize(3 * info.triangle_count);
  check(stipple_asset_read_rest(context.get(), arguments.in.c_str(), info.vertex_count,
                                rest.positions.data(), info.triangle_count, rest.triangles.data()));
  const Shape posed = shapeOf(context, arguments.posed);
  requireOneMesh(rest, arguments.in, posed, arguments.posed);
  return carriedBy(posed, cloud, bindingOf(cloud, rest, info.reach));
}

void decode(const Context& context, const Arguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  StippleDecodeOptions options;
  stipple_decode_options_init(&options);
  checkBudget(arguments);
  options.gaussians_per_anchor =
      static_cast<uint32_t>(counted(arguments.gaussians_per_anchor, "--gaussians-per-anchor", 32));
  options.order =
      arguments.order == "progressive" ? STIPPLE_ORDER_PROGRESSIVE : STIPPLE_ORDER_SYSTEMATIC;
  options.seed = arguments.seed;
  options.smooth = arguments.smooth ? 1 : 0;
  options.time = arguments.time;
  // A glTF file that is there may hold a mesh; what is written over it holds splats.
  const FileKind out_kind =
      hasSplatExtension(arguments.out) ? FileKind::kSplats : fileKind(arguments.out);
  if (out_kind != FileKind::kSplats && out_kind != FileKind::kModel) {
    throw Failure("'" + arguments.out + "' is not a splat file; " + splatExtensions(true) +
                  " or .stipple.safetensors is expected");
  }
  if (!arguments.posed.empty() && fileKind(arguments.in) != FileKind::kModel) {
    throw Failure("--posed is for a model that 'stipple bind' has made; '" + arguments.in +
                  "' is none");
  }
  const Source source = sourceOf(context, arguments);
  // Refined splats of a mesh are explicit ones: their model is a tree of merges.
  const bool of_refined = refines(arguments) && source.mesh != nullptr;
  if (out_kind == FileKind::kModel && !of_refined) {
    check(stipple_model_save(source.model.get(), arguments.out.c_str()));
    return;
  }
  options.anchor_count = budgetOf(source.model, arguments);
  const auto job = make<Job>(stipple_model_decode_start, source.model.get(), &options);
  finish(job);
  auto cloud = make<Cloud>(stipple_job_cloud, job.get());
  if (refines(arguments)) cloud = refined(cloud, source, arguments);
  if (out_kind == FileKind::kModel) {
    const Model tree = hierarchyOf(context, cloud, arguments.seed);
    check(stipple_model_save(tree.get(), arguments.out.c_str()));
    return;
  }
  if (!arguments.posed.empty()) cloud = carried(context, cloud, arguments);
  check(stipple_cloud_save(cloud.get(), arguments.out.c_str(), nullptr));
  auto info = sized<StippleCloudInfo>();
  check(stipple_cloud_info(cloud.get(), &info));
  Report report;
  report.add("anchors", options.anchor_count);
  report.add("gaussians", info.count);
  report.add("seconds", secondsSince(start));
  report.print(false);
}

}  // namespace

void addDecode(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("decode", "A mesh, splats or a model to splats of any number");
  command
      ->add_option("in", arguments->in,
                   "Mesh (.glb, .gltf), splat file or model (.stipple.safetensors)")
      ->required();
  command
      ->add_option("out", arguments->out,
                   "Splats (.ply), or the model itself "
                   "(.stipple.safetensors)")
      ->required();
  auto* anchors = command->add_option(
      "--anchors", arguments->anchors,
      "Anchor budget; without it what suits the model: 20,000 of a mesh, all existing splats, of a "
      "fitted field and of generated splats a number that it has learned with");
  command->add_option("--ratio", arguments->ratio, "Budget as a share of existing splats, 0..1")
      ->excludes(anchors);
  command->add_option(
      "--refine", arguments->refine,
      "Number of steps that fit the result to images of the mesh, or of all existing "
      "splats");
  command->add_option("--refine-seconds", arguments->refine_seconds,
                      "This fitting ends after so many seconds, however busy the machine is, with "
                      "the steps that fit into them; without --refine as many as that are");
  command
      ->add_option("--gaussians-per-anchor", arguments->gaussians_per_anchor,
                   "Splats made of each anchor")
      ->capture_default_str();
  command->add_flag("--smooth", arguments->smooth,
                    "For budgets that move: between powers of two, splats on the way from the one "
                    "to the other, up to twice as many as the budget");
  command->add_option("--order", arguments->order, "systematic, or progressive (nested budgets)")
      ->check(CLI::IsMember({"systematic", "progressive"}))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed)->capture_default_str();
  command
      ->add_option("--detail-weight", arguments->detail_weight,
                   "0: uniform over the area; more: denser at detail")
      ->capture_default_str();
  command->add_option("--samples", arguments->samples, "Surface samples, 0: automatic")
      ->capture_default_str();
  command->add_option("--time", arguments->time, "Seconds, for models of splats that move")
      ->capture_default_str();
  command->add_option("--posed", arguments->posed,
                      "Mesh (.glb, .gltf): the splats as it carries them, where the model brings "
                      "the same mesh at rest ('stipple bind')");
  command->callback([arguments, &context] { decode(context, *arguments); });
}

}  // namespace stipple::cli
