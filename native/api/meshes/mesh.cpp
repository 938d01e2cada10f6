#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "data/position_bounds.h"
#include "fit/registration/registration.h"
#include "io/mesh_file.h"
#include "io/mesh_writer.h"
#include "math/affine.h"
#include "mesh/mesh_part.h"
#include "mesh/surface_pieces.h"

using namespace stipple;
using namespace stipple::api;

namespace {

constexpr uint32_t kMaxTextureSide = 65536;
constexpr uint32_t kMaxViewDirections = 1024;

/// The mesh to change; a copy where a job holds a share of it.
TriMesh& writable(StippleMesh& handle) {
  if (handle.mesh.use_count() > 1) handle.mesh = std::make_shared<TriMesh>(*handle.mesh);
  return *handle.mesh;
}

MeshPart partFrom(const StippleMeshPart& given) {
  MeshPart part;
  part.vertex_count = given.vertex_count;
  part.triangle_count = given.triangle_count;
  part.positions = &require(given.positions, "part->positions");
  part.triangles = &require(given.triangles, "part->triangles");
  part.corner_normals = given.corner_normals;
  part.corner_uvs = given.corner_uvs;
  part.corner_colours = given.corner_colours;
  part.triangle_materials = given.triangle_materials;
  part.object_to_world = Eigen::Map<const Mat4d>(given.matrix);
  return part;
}

/// The mesh that a job made, or whose shape it changed.
const TriMesh& meshOf(const StippleJob& job) {
  {
    std::lock_guard<std::mutex> lock(job.mutex);
    const auto* changed = std::get_if<std::shared_ptr<const RegisteredMesh>>(&job.result);
    if (changed && job.state == STIPPLE_JOB_DONE) return (*changed)->mesh;
  }
  return *jobResult<std::shared_ptr<const TriMesh>>(job, "mesh");
}

}  // namespace

extern "C" {

StippleStatus stipple_mesh_create(StippleContext* context, StippleMesh** mesh) {
  return guarded([&] {
    require(context, "context");
    require(mesh, "mesh") = new StippleMesh{context->state, std::make_shared<TriMesh>()};
  });
}

void stipple_mesh_free(StippleMesh* mesh) {
  delete mesh;
}

StippleStatus stipple_mesh_add_texture(StippleMesh* mesh, uint32_t width, uint32_t height,
                                       uint32_t channels, const float* pixels, uint32_t srgb,
                                       uint32_t* index) {
  return guarded([&] {
    require(mesh, "mesh");
    require(pixels, "pixels");
    require(index, "index");
    if (width < 1 || height < 1 || width > kMaxTextureSide || height > kMaxTextureSide ||
        (channels != 3 && channels != 4)) {
      fail(ErrorCode::kInvalidArgument, "texture is " + std::to_string(width) + " x " +
                                            std::to_string(height) + " with " +
                                            std::to_string(channels) +
                                            " channels; sides of 1 to 65536 and 3 or 4 channels "
                                            "are allowed");
    }
    Image image;
    image.width = width;
    image.height = height;
    image.channels = channels;
    image.transfer = enumValue<Transfer>(srgb, 1, "srgb");
    const size_t count = image.pixelCount() * channels;
    requireFinite(pixels, count, channels, "texture: pixel");
    image.pixels.assign(pixels, pixels + count);
    TriMesh& target = writable(*mesh);
    target.textures.push_back(std::move(image));
    *index = static_cast<uint32_t>(target.textures.size() - 1);
  });
}

StippleStatus stipple_mesh_add_material(StippleMesh* mesh, const StippleMaterial* material,
                                        uint32_t* index) {
  return guarded([&] {
    require(mesh, "mesh");
    require(index, "index");
    const StippleMaterial given = complete(material, "material");
    Material made;
    made.colour = enumValue<MaterialColour>(given.colour, 2, "material->colour");
    requireFinite(given.base_colour, 4, 4, "material->base_colour of material");
    std::copy(given.base_colour, given.base_colour + 4, made.base_colour);
    if (made.colour == MaterialColour::kTexture) {
      if (given.texture >= mesh->mesh->textures.size()) {
        fail(ErrorCode::kInvalidArgument,
             "material->texture is " + std::to_string(given.texture) + "; the mesh has " +
                 std::to_string(mesh->mesh->textures.size()) + " textures");
      }
      made.texture = given.texture;
    }
    if (given.view_count != 0) {
      const uint32_t* textures = &require(given.view_textures, "material->view_textures");
      made.view_textures.assign(textures, textures + given.view_count);
      requireViewTextures(*mesh->mesh, made, "material");
    }
    TriMesh& target = writable(*mesh);
    target.materials.push_back(std::move(made));
    *index = static_cast<uint32_t>(target.materials.size() - 1);
  });
}

StippleStatus stipple_mesh_set_view_directions(StippleMesh* mesh, const float* directions,
                                               uint32_t count) {
  return guarded([&] {
    require(mesh, "mesh");
    require(directions, "directions");
    if (count == 0 || count > kMaxViewDirections) {
      fail(ErrorCode::kInvalidArgument,
           "view direction count is " + std::to_string(count) + "; 1 to 1024 is allowed");
    }
    if (!mesh->mesh->view_directions.empty()) {
      fail(ErrorCode::kInvalidArgument, "the mesh has view directions already");
    }
    const std::vector<float> given(directions, directions + size_t{count} * 3);
    requireViewDirections(given);
    writable(*mesh).view_directions = given;
  });
}

StippleStatus stipple_mesh_add_part(StippleMesh* mesh, const StippleMeshPart* part) {
  return guarded([&] {
    require(mesh, "mesh");
    const StippleMeshPart given = complete(part, "part");
    if (given.triangle_count == 0) return;
    const MeshPart checked = partFrom(given);
    validate(checked, *mesh->mesh);
    appendPart(writable(*mesh), checked);
  });
}

StippleStatus stipple_mesh_load(StippleContext* context, const char* path_utf8,
                                StippleMesh** mesh) {
  return guarded([&] {
    require(context, "context");
    require(mesh, "mesh");
    const std::string path = &require(path_utf8, "path_utf8");
    *mesh = new StippleMesh{context->state, std::make_shared<TriMesh>(readMeshFile(path))};
  });
}

StippleStatus stipple_mesh_info(const StippleMesh* mesh, StippleMeshInfo* info) {
  return guarded([&] {
    const TriMesh& triangles = *require(mesh, "mesh").mesh;
    StippleMeshInfo out = {};
    out.material_count = static_cast<uint32_t>(triangles.materials.size());
    out.vertex_count = triangles.vertexCount();
    out.triangle_count = triangles.triangleCount();
    fillBounds(triangles.positions, out.bounds_min, out.bounds_max);
    deliver(info, out, "info");
  });
}

StippleStatus stipple_job_mesh(const StippleJob* job, StippleMesh** mesh) {
  return guarded([&] {
    const TriMesh& made = meshOf(require(job, "job"));
    // Meshes can be added to, so each handle has one of its own.
    require(mesh, "mesh") = new StippleMesh{job->context, std::make_shared<TriMesh>(made)};
  });
}

StippleStatus stipple_mesh_read(const StippleMesh* mesh, const StippleMeshBuffers* buffers) {
  return guarded([&] {
    const TriMesh& from = *require(mesh, "mesh").mesh;
    const StippleMeshBuffers to = complete(buffers, "buffers");
    const auto need = [](uint64_t count, uint64_t capacity, const char* what) {
      if (capacity >= count) return;
      fail(ErrorCode::kBufferTooSmall, std::string("buffers->") + what + "_capacity is " +
                                           std::to_string(capacity) + "; " + std::to_string(count) +
                                           " are needed");
    };
    if (to.positions) need(from.vertexCount(), to.vertex_capacity, "vertex");
    if (to.triangles) need(from.triangleCount(), to.triangle_capacity, "triangle");
    if (to.positions) std::copy(from.positions.begin(), from.positions.end(), to.positions);
    if (to.triangles) std::copy(from.triangles.begin(), from.triangles.end(), to.triangles);
  });
}

StippleStatus stipple_mesh_topology(const StippleMesh* mesh, StippleMeshTopology* topology) {
  return guarded([&] {
    const MeshTopology made = topologyOf(*require(mesh, "mesh").mesh);
    StippleMeshTopology out = {};
    out.edge_count = made.edge_count;
    out.open_edge_count = made.open_edge_count;
    out.piece_count = made.piece_count;
    out.euler = made.euler;
    out.volume = made.volume;
    deliver(topology, out, "topology");
  });
}

StippleStatus stipple_mesh_save(const StippleMesh* mesh, const char* path_utf8) {
  return guarded(
      [&] { writeMeshFile(*require(mesh, "mesh").mesh, &require(path_utf8, "path_utf8")); });
}

StippleStatus stipple_mesh_save_reshaped(const StippleMesh* mesh, const char* source_utf8,
                                         const char* path_utf8) {
  return guarded([&] {
    writeReshapedMesh(*require(mesh, "mesh").mesh, &require(source_utf8, "source_utf8"),
                      &require(path_utf8, "path_utf8"));
  });
}

}  // extern "C"
