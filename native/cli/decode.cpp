#include <algorithm>
#include <chrono>
#include <memory>

#include "cli/commands.h"
#include "cli/formats.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::string in, out, order = "systematic";
  int64_t anchors = 20000;
  int64_t gaussians_per_anchor = 1;
  uint64_t seed = 0;
  uint64_t samples = 0;
  double detail_weight = 1.0;
};

Model modelFrom(const Context& context, const Arguments& arguments) {
  const FileKind kind = fileKind(arguments.in);
  if (kind == FileKind::kModel) {
    return make<Model>(stipple_model_load, context.get(), arguments.in.c_str());
  }
  // A glTF file of splats may hold meshes too; one without gets the mesh reader's words.
  const std::string ending =
      arguments.in.substr(std::min(arguments.in.rfind('.'), arguments.in.size()));
  if (kind != FileKind::kMesh && ending != ".glb" && ending != ".gltf") {
    throw Failure("'" + arguments.in +
                  "' is not a source of splats; .glb, .gltf or .stipple.safetensors is expected");
  }
  const auto mesh = make<Mesh>(stipple_mesh_load, context.get(), arguments.in.c_str());
  StippleModelFromMeshOptions options;
  stipple_model_from_mesh_options_init(&options);
  options.detail_weight = arguments.detail_weight;
  options.sample_count = arguments.samples;
  options.seed = arguments.seed;
  const auto job = make<Job>(stipple_model_from_mesh_start, context.get(),
                             const_cast<const StippleMesh*>(mesh.get()),
                             const_cast<const StippleModelFromMeshOptions*>(&options));
  finish(job);
  return make<Model>(stipple_job_model, job.get());
}

/// Negative counts must reach the message as they were typed, not wrapped around.
uint64_t counted(int64_t value, const char* name, int64_t last) {
  if (value < 1 || value > last) {
    throw Failure(std::string(name) + " is " + std::to_string(value) + "; 1 to " +
                  std::to_string(last) + " is allowed");
  }
  return static_cast<uint64_t>(value);
}

void decode(const Context& context, const Arguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  StippleDecodeOptions options;
  stipple_decode_options_init(&options);
  options.anchor_count = counted(arguments.anchors, "--anchors", STIPPLE_MAX_ANCHORS);
  options.gaussians_per_anchor =
      static_cast<uint32_t>(counted(arguments.gaussians_per_anchor, "--gaussians-per-anchor", 32));
  options.order =
      arguments.order == "progressive" ? STIPPLE_ORDER_PROGRESSIVE : STIPPLE_ORDER_SYSTEMATIC;
  options.seed = arguments.seed;
  // A glTF file that is there may hold a mesh; what is written over it holds splats.
  const FileKind out_kind =
      hasSplatEnding(arguments.out) ? FileKind::kSplats : fileKind(arguments.out);
  if (out_kind != FileKind::kSplats && out_kind != FileKind::kModel) {
    throw Failure("'" + arguments.out + "' is not a splat file; " + splatEndings(true) +
                  " or .stipple.safetensors is expected");
  }
  const Model model = modelFrom(context, arguments);
  if (out_kind == FileKind::kModel) {
    check(stipple_model_save(model.get(), arguments.out.c_str()));
    return;
  }
  const auto job = make<Job>(stipple_model_decode_start, model.get(), &options);
  finish(job);
  const auto cloud = make<Cloud>(stipple_job_cloud, job.get());
  check(stipple_cloud_save(cloud.get(), arguments.out.c_str(), nullptr));
  auto info = sized<StippleCloudInfo>();
  check(stipple_cloud_info(cloud.get(), &info));
  Report report;
  report.add("anchors", options.anchor_count);
  report.add("gaussians", info.count);
  report.add("seconds",
             std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  report.print(false);
}

}  // namespace

void addDecode(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("decode", "A mesh or a model to splats of any number");
  command->add_option("in", arguments->in, "Mesh (.glb, .gltf) or model (.stipple.safetensors)")
      ->required();
  command
      ->add_option("out", arguments->out,
                   "Splats (.ply), or the model itself "
                   "(.stipple.safetensors)")
      ->required();
  command->add_option("--anchors", arguments->anchors, "Anchor budget")->capture_default_str();
  command
      ->add_option("--gaussians-per-anchor", arguments->gaussians_per_anchor,
                   "Splats made of each anchor")
      ->capture_default_str();
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
  command->callback([arguments, &context] { decode(context, *arguments); });
}

}  // namespace stipple::cli
