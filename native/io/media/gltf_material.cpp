// Based on: glTF 2.0 Specification, section 3.9 (base colour = factor * texture * COLOR_0, alpha
// modes), and the extension KHR_texture_transform.
#include "io/media/gltf_material.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "io/media/gltf_model.h"
#include "io/media/media_calls.h"
#include "math/colour.h"

namespace stipple::media {

namespace {

enum AlphaMode { kOpaque, kMask, kBlend };

/// Opaque surfaces ignore alpha, masked ones have all or nothing.
float effectiveAlpha(float alpha, int mode, double cutoff) {
  if (mode == kOpaque) return 1.0f;
  if (mode == kMask) return static_cast<double>(alpha) >= cutoff ? 1.0f : 0.0f;
  return alpha;
}

double numberAt(const tinygltf::Value& object, const char* key, size_t index, double otherwise) {
  if (!object.Has(key) || !object.Get(key).IsArray()) return otherwise;
  const tinygltf::Value& array = object.Get(key);
  if (index >= array.ArrayLen()) return otherwise;
  const tinygltf::Value& value = array.Get(static_cast<int>(index));
  return value.IsNumber() ? value.GetNumberAsDouble() : otherwise;
}

/// Translation * rotation * scale of the extension, counter-clockwise in the frame with v down.
void readTransform(const tinygltf::Value& extension, MaterialUse& use) {
  const double ox = numberAt(extension, "offset", 0, 0.0);
  const double oy = numberAt(extension, "offset", 1, 0.0);
  const double sx = numberAt(extension, "scale", 0, 1.0);
  const double sy = numberAt(extension, "scale", 1, 1.0);
  double angle = 0.0;
  if (extension.Has("rotation") && extension.Get("rotation").IsNumber()) {
    angle = extension.Get("rotation").GetNumberAsDouble();
  }
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const double matrix[6] = {c * sx, s * sy, ox, -s * sx, c * sy, oy};
  std::copy(matrix, matrix + 6, use.uv_matrix);
  if (extension.Has("texCoord") && extension.Get("texCoord").IsNumber()) {
    use.uv_set = static_cast<int>(extension.Get("texCoord").GetNumberAsDouble());
  }
}

}  // namespace

struct MaterialReader::Base {
  std::vector<double> factor = {1, 1, 1, 1};
  int texture = -1;
  int alpha_mode = kOpaque;
  double alpha_cutoff = 0.5;
  const tinygltf::TextureInfo* info = nullptr;
};

MaterialReader::Base MaterialReader::baseOf(int index) const {
  Base base;
  if (index < 0) return base;
  if (static_cast<size_t>(index) >= model_.materials.size()) {
    fail(ErrorCode::kFormat, path_ + " uses material " + std::to_string(index) + "; the file has " +
                                 std::to_string(model_.materials.size()));
  }
  const tinygltf::Material& material = model_.materials[static_cast<size_t>(index)];
  const tinygltf::PbrMetallicRoughness& pbr = material.pbrMetallicRoughness;
  if (pbr.baseColorFactor.size() == 4) base.factor = pbr.baseColorFactor;
  for (const double value : base.factor) {
    requireFinite(value, (path_ + ": base colour of material " + std::to_string(index)).c_str());
  }
  base.texture = pbr.baseColorTexture.index;
  base.info = &pbr.baseColorTexture;
  base.alpha_mode = material.alphaMode == "MASK"    ? kMask
                    : material.alphaMode == "BLEND" ? kBlend
                                                    : kOpaque;
  base.alpha_cutoff = material.alphaCutoff;
  return base;
}

void MaterialReader::shade(int material, float* rgba) const {
  const Base base = baseOf(material);
  for (size_t c = 0; c < 4; ++c) rgba[c] *= static_cast<float>(base.factor[c]);
  rgba[3] = effectiveAlpha(rgba[3], base.alpha_mode, base.alpha_cutoff);
}

uint32_t MaterialReader::texture(int image, const Base& base) {
  const auto key = std::make_tuple(image, base.factor, base.alpha_mode, base.alpha_cutoff);
  if (const auto known = textures_.find(key); known != textures_.end()) return known->second;
  const tinygltf::Image& source = model_.images[static_cast<size_t>(image)];
  const std::string name = path_ + ": image " + std::to_string(image) +
                           (source.uri.empty() ? "" : " (" + source.uri + ")");
  if (images_[static_cast<size_t>(image)].empty()) {
    fail(ErrorCode::kIo, name + " is missing or cannot be read");
  }
  // Of one image there may be as many textures as there are materials.
  DecodedImage decoded =
      decodeImageBytes(images_[static_cast<size_t>(image)], name, {texture_bytes_, file_bytes_});
  texture_bytes_ += decoded.pixels.size() * sizeof(float);
  Image result;
  result.width = decoded.info.width;
  result.height = decoded.info.height;
  result.channels = decoded.info.channels;
  result.transfer = Transfer::kSrgb;
  result.pixels = std::move(decoded.pixels);
  const bool has_alpha = result.channels == 4;
  if (has_alpha && decoded.info.alpha_is_associated != 0) {
    for (size_t i = 0; i < result.pixelCount(); ++i) {
      float* pixel = &result.pixels[i * 4];
      for (size_t c = 0; c < 3 && pixel[3] > 0.0f; ++c) {
        pixel[c] = std::min(pixel[c] / pixel[3], 1.0f);
      }
    }
  }
  const size_t channels = result.channels;
  const bool plain = base.factor == std::vector<double>{1, 1, 1, 1};
  const bool keeps_alpha = has_alpha && base.alpha_mode == kBlend;
  if (!plain && channels == 1) {
    fail(ErrorCode::kUnsupported, name + " is grey and tinted by its material; RGB is needed");
  }
  if (!plain || (has_alpha && !keeps_alpha)) {
    constexpr size_t kPixelsPerTask = 65536;
    parallelFor(result.pixelCount(), kPixelsPerTask, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        float* pixel = &result.pixels[i * channels];
        for (size_t c = 0; c < 3 && !plain; ++c) {
          pixel[c] = linearToSrgb(srgbToLinear(pixel[c]) * static_cast<float>(base.factor[c]));
        }
        if (has_alpha) {
          pixel[3] = effectiveAlpha(pixel[3] * static_cast<float>(base.factor[3]), base.alpha_mode,
                                    base.alpha_cutoff);
        }
      }
    });
  }
  const auto index = static_cast<uint32_t>(mesh_.textures.size());
  mesh_.textures.push_back(std::move(result));
  textures_[key] = index;
  return index;
}

MaterialUse MaterialReader::use(int index, bool has_colours) {
  const auto key = std::make_pair(index, has_colours);
  if (const auto known = uses_.find(key); known != uses_.end()) return known->second;
  const Base base = baseOf(index);
  MaterialUse use;
  Material material;
  for (size_t c = 0; c < 4; ++c) material.base_colour[c] = static_cast<float>(base.factor[c]);
  material.base_colour[3] =
      effectiveAlpha(material.base_colour[3], base.alpha_mode, base.alpha_cutoff);
  if (base.texture >= 0) {
    const bool known = static_cast<size_t>(base.texture) < model_.textures.size();
    int image = known ? model_.textures[static_cast<size_t>(base.texture)].source : -1;
    if (known && image < 0) {
      // EXT_texture_webp names its image in the extension.
      const auto& extensions = model_.textures[static_cast<size_t>(base.texture)].extensions;
      const auto webp = extensions.find("EXT_texture_webp");
      if (webp != extensions.end() && webp->second.Has("source")) {
        image = static_cast<int>(webp->second.Get("source").GetNumberAsDouble());
      }
    }
    if (image < 0 || static_cast<size_t>(image) >= images_.size()) {
      fail(ErrorCode::kFormat, path_ + ": texture " + std::to_string(base.texture) +
                                   " of material " + std::to_string(index) +
                                   " has no image that can be read");
    }
    use.needs_uvs = true;
    use.uv_set = base.info->texCoord;
    const auto transform = base.info->extensions.find("KHR_texture_transform");
    if (transform != base.info->extensions.end()) readTransform(transform->second, use);
    material.colour = MaterialColour::kTexture;
    material.texture = texture(image, base);
  } else if (has_colours) {
    material.colour = MaterialColour::kCorner;
  }
  use.material = static_cast<uint32_t>(mesh_.materials.size());
  mesh_.materials.push_back(material);
  uses_[key] = use;
  return use;
}

}  // namespace stipple::media
