#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "data/meshes/tri_mesh.h"
#include "io/media/gltf_scene.h"

namespace stipple::media {

struct GltfModel;

/// How a glTF material is used by one primitive.
struct MaterialUse {
  uint32_t material = 0;  ///< index into TriMesh::materials
  bool needs_uvs = false;
  int uv_set = 0;
  /// [2,3] rows: glTF texture coordinates → those of the picture (KHR_texture_transform).
  double uv_matrix[6] = {1, 0, 0, 0, 1, 0};
};

/// Turns glTF materials into ours: factor, texture, alpha mode folded into one colour source.
class MaterialReader {
 public:
  MaterialReader(const GltfModel& model, const std::string& path, const GltfScene& scene,
                 TriMesh& mesh)
      : model_(model),
        path_(path),
        images_(scene.images()),
        file_bytes_(scene.fileBytes()),
        mesh_(mesh) {}

  /// In: material, -1 for glTF's default; has_colours, whether the primitive has COLOR_0.
  MaterialUse use(int material, bool has_colours);
  /// Colour of a corner: COLOR_0 times the factor, alpha by the alpha mode.
  void shade(int material, float* rgba) const;

 private:
  struct Base;
  Base baseOf(int material) const;
  uint32_t texture(int image, const Base& base);

  const GltfModel& model_;
  const std::string& path_;
  /// The undecoded bytes of each image; empty where the file was not found.
  const std::vector<std::vector<unsigned char>>& images_;
  uint64_t file_bytes_;
  TriMesh& mesh_;
  std::map<std::pair<int, bool>, MaterialUse> uses_;
  std::map<std::tuple<int, std::vector<double>, int, double>, uint32_t> textures_;
  uint64_t texture_bytes_ = 0;  ///< of all textures so far
};

}  // namespace stipple::media
