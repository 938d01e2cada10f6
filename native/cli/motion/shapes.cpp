#include "cli/motion/shapes.h"

namespace stipple::cli {

Shape shapeOf(const Context& context, const std::string& mesh_path) {
  const auto mesh = make<Mesh>(stipple_mesh_load, context.get(), mesh_path.c_str());
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

void requireOneMesh(const Shape& rest, const std::string& rest_path, const Shape& posed,
                    const std::string& posed_path) {
  if (rest.triangles == posed.triangles && rest.positions.size() == posed.positions.size()) return;
  throw Failure(posed_path + ": its " + std::to_string(posed.triangles.size() / 3) +
                " triangles are not those of " + rest_path + ", which has " +
                std::to_string(rest.triangles.size() / 3) +
                "; both files must be shapes of one mesh");
}

Binding bindingOf(const Cloud& cloud, const Shape& rest, uint32_t reach) {
  const auto job = make<Job>(stipple_cloud_bind_start, const_cast<const StippleCloud*>(cloud.get()),
                             rest.positions.data(), uint64_t{rest.positions.size() / 3},
                             rest.triangles.data(), uint64_t{rest.triangles.size() / 3}, reach);
  finish(job);
  return make<Binding>(stipple_job_binding, const_cast<const StippleJob*>(job.get()));
}

Cloud carriedBy(const Shape& posed, const Cloud& cloud, const Binding& binding) {
  return make<Cloud>(stipple_cloud_carry, const_cast<const StippleCloud*>(cloud.get()),
                     const_cast<const StippleBinding*>(binding.get()), posed.positions.data(),
                     uint64_t{posed.positions.size() / 3});
}

}  // namespace stipple::cli
