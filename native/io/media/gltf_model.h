#pragma once

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#include <tiny_gltf.h>

#include <span>

#include "base/default_init_vector.h"

namespace stipple::media {

/// tinygltf's model, whose buffer 0 may lie beside it: tinygltf copies the binary part of a GLB
/// twice, which takes longer than reading it.
struct GltfModel : tinygltf::Model {
  DefaultInitVector<unsigned char> binary;
  bool has_binary = false;  ///< `binary` stands for buffer 0

  std::span<const unsigned char> bytesOf(size_t buffer) const {
    if (has_binary && buffer == 0) return binary;
    return buffers[buffer].data;
  }
};

}  // namespace stipple::media
