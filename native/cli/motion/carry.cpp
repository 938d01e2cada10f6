#include <memory>
#include <string>

#include "cli/commands.h"
#include "cli/motion/shapes.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::string in, rest, posed, out;
  bool around = false;
  bool json = false;
};

void carry(const Context& context, const Arguments& arguments) {
  const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments.in.c_str());
  const Shape rest = shapeOf(context, arguments.rest);
  const Shape posed = shapeOf(context, arguments.posed);
  requireOneMesh(rest, arguments.rest, posed, arguments.posed);
  const Binding binding = bindingOf(cloud, rest, reachOf(arguments.around));
  const Cloud carried = carriedBy(posed, cloud, binding);
  StippleCloudSaveOptions options;
  stipple_cloud_save_options_init(&options);
  check(stipple_cloud_save(carried.get(), arguments.out.c_str(), &options));
  auto info = sized<StippleBindingInfo>();
  check(stipple_binding_info(binding.get(), &info));
  Report report;
  report.add("splats", info.splat_count);
  report.add("vertices", info.vertex_count);
  report.add("triangles", info.triangle_count);
  report.add("triangles_per_splat", uint64_t{info.influences});
  report.print(arguments.json);
}

/// Writes a model that brings the mesh which its splats follow.
void bindModel(const Context& context, const Arguments& arguments) {
  if (fileKind(arguments.in) != FileKind::kModel || fileKind(arguments.out) != FileKind::kModel) {
    throw Failure("'" + (hasModelExtension(arguments.in) ? arguments.out : arguments.in) +
                  "' is not a model; .stipple.safetensors is expected, which 'stipple decode' "
                  "makes of a mesh or of splats");
  }
  const Shape rest = shapeOf(context, arguments.rest);
  check(stipple_asset_bind(context.get(), arguments.in.c_str(), rest.positions.data(),
                           rest.positions.size() / 3, rest.triangles.data(),
                           rest.triangles.size() / 3, reachOf(arguments.around),
                           arguments.out.c_str()));
  auto info = sized<StippleRestInfo>();
  check(stipple_asset_rest_info(context.get(), arguments.out.c_str(), &info));
  Report report;
  report.add("vertices", info.vertex_count);
  report.add("triangles", info.triangle_count);
  report.add("follows", info.reach == STIPPLE_BIND_AROUND ? "around" : "surface");
  report.print(arguments.json);
}

void addReach(CLI::App& command, Arguments& arguments) {
  command.add_flag("--around", arguments.around,
                   "Follow several near triangles smoothly, not the nearest alone: for scans near "
                   "a mesh or inside a cage");
  command.add_flag("--json", arguments.json, "Figures as JSON");
}

}  // namespace

void addCarry(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("carry", "Splats as a mesh carries them from one shape to another");
  command->add_option("in", arguments->in, "Splat file, in the frame of the meshes")->required();
  command
      ->add_option("rest", arguments->rest, "Mesh (.gltf, .glb) in the shape that the splats fit")
      ->required();
  command->add_option("posed", arguments->posed, "The same mesh in another shape")->required();
  command->add_option("out", arguments->out, "Splat file to write")->required();
  addReach(*command, *arguments);
  command->callback([arguments, &context] { carry(context, *arguments); });
}

void addBind(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "bind", "A model that brings the mesh which its splats follow, at any budget");
  command->add_option("in", arguments->in, "Model (.stipple.safetensors), in the frame of the mesh")
      ->required();
  command
      ->add_option("rest", arguments->rest, "Mesh (.gltf, .glb) in the shape that the splats fit")
      ->required();
  command->add_option("out", arguments->out, "Model to write")->required();
  addReach(*command, *arguments);
  command->callback([arguments, &context] { bindModel(context, *arguments); });
}

}  // namespace stipple::cli
