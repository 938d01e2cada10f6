#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

struct Arguments {
  std::string in, rest, posed, out;
  bool around = false;
  bool json = false;
};

/// The triangles of a mesh file.
struct Shape {
  std::vector<float> positions;     ///< [V,3]
  std::vector<uint32_t> triangles;  ///< [T,3]
};

Shape shapeOf(const Context& context, const std::string& path) {
  const auto mesh = make<Mesh>(stipple_mesh_load, context.get(), path.c_str());
  auto info = sized<StippleMeshInfo>();
  check(stipple_mesh_info(mesh.get(), &info));
  Shape shape;
  shape.positions.resize(3 * info.vertex_count);
  shape.triangles.resize(3 * info.triangle_count);
  auto buffers = sized<StippleMeshBuffers>();
  buffers.vertex_capacity = info.vertex_count;
  buffers.triangle_capacity = info.triangle_count;
  buffers.positions = shape.positions.data();
  buffers.triangles = shape.triangles.data();
  check(stipple_mesh_read(mesh.get(), &buffers));
  return shape;
}

void carry(const Context& context, const Arguments& arguments) {
  const auto cloud = make<Cloud>(stipple_cloud_load, context.get(), arguments.in.c_str());
  const Shape rest = shapeOf(context, arguments.rest);
  const Shape posed = shapeOf(context, arguments.posed);
  if (rest.triangles != posed.triangles) {
    throw Failure(arguments.posed + ": its " + std::to_string(posed.triangles.size() / 3) +
                  " triangles are not those of " + arguments.rest + ", which has " +
                  std::to_string(rest.triangles.size() / 3) +
                  "; both files must be shapes of one mesh");
  }
  const auto job = make<Job>(
      stipple_cloud_bind_start, const_cast<const StippleCloud*>(cloud.get()), rest.positions.data(),
      uint64_t{rest.positions.size() / 3}, rest.triangles.data(),
      uint64_t{rest.triangles.size() / 3},
      static_cast<uint32_t>(arguments.around ? STIPPLE_BIND_AROUND : STIPPLE_BIND_SURFACE));
  finish(job);
  const auto binding = make<Binding>(stipple_job_binding, const_cast<const StippleJob*>(job.get()));
  const auto carried =
      make<Cloud>(stipple_cloud_carry, const_cast<const StippleCloud*>(cloud.get()),
                  const_cast<const StippleBinding*>(binding.get()), posed.positions.data(),
                  uint64_t{posed.positions.size() / 3});
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
  command->add_flag("--around", arguments->around,
                    "Follow several near triangles smoothly, not the nearest alone: for scans near "
                    "a mesh or inside a cage");
  command->add_flag("--json", arguments->json, "Figures as JSON");
  command->callback([arguments, &context] { carry(context, *arguments); });
}

}  // namespace stipple::cli
