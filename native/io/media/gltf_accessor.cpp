// Based on: The Khronos 3D Formats Working Group, glTF 2.0 Specification, section 3.6 (buffers,
// accessors, sparse accessors, normalised integers).
#include "io/media/gltf_accessor.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <type_traits>

#include "base/error.h"
#include "io/media/gltf_model.h"

namespace stipple::media {

namespace {

[[noreturn]] void failHere(const std::string& what) {
  fail(ErrorCode::kFormat, what);
}

const tinygltf::Accessor& accessorAt(const GltfModel& model, int index, const std::string& what) {
  if (index < 0 || static_cast<size_t>(index) >= model.accessors.size()) {
    failHere(what + " names accessor " + std::to_string(index) + "; the file has " +
             std::to_string(model.accessors.size()));
  }
  return model.accessors[static_cast<size_t>(index)];
}

/// Bytes of `count` elements inside a buffer view, range checked.
struct Range {
  const unsigned char* first = nullptr;
  size_t stride = 0;
};

Range rangeOf(const GltfModel& model, int view_index, size_t offset, size_t count,
              size_t element_bytes, const std::string& what) {
  if (view_index < 0 || static_cast<size_t>(view_index) >= model.bufferViews.size()) {
    failHere(what + " names buffer view " + std::to_string(view_index) + "; the file has " +
             std::to_string(model.bufferViews.size()));
  }
  const tinygltf::BufferView& view = model.bufferViews[static_cast<size_t>(view_index)];
  if (view.buffer < 0 || static_cast<size_t>(view.buffer) >= model.buffers.size()) {
    failHere(what + " names buffer " + std::to_string(view.buffer) + "; the file has " +
             std::to_string(model.buffers.size()));
  }
  const std::span<const unsigned char> bytes = model.bytesOf(static_cast<size_t>(view.buffer));
  const size_t stride = view.byteStride != 0 ? view.byteStride : element_bytes;
  if (view.byteOffset > bytes.size() || view.byteLength > bytes.size() - view.byteOffset) {
    failHere(what + " lies in a buffer view of " + std::to_string(view.byteLength) +
             " bytes from byte " + std::to_string(view.byteOffset) + "; the buffer holds " +
             std::to_string(bytes.size()));
  }
  // Compared by division, because count * stride of a damaged file may not fit.
  const size_t room = view.byteLength;
  const bool fits = count == 0 || (offset <= room && element_bytes <= room - offset &&
                                   count - 1 <= (room - offset - element_bytes) / stride);
  if (!fits || stride < element_bytes) {
    failHere(what + " claims " + std::to_string(count) + " elements of " +
             std::to_string(element_bytes) + " bytes, " + std::to_string(stride) +
             " apart, from byte " + std::to_string(offset) + " of a buffer view of " +
             std::to_string(room) + " bytes");
  }
  return {bytes.data() + view.byteOffset + (count == 0 ? 0 : offset), stride};
}

template <typename T>
T load(const unsigned char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

size_t componentBytes(int type, const std::string& what) {
  const int bytes = tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(type));
  if (bytes <= 0) failHere(what + " has the component type " + std::to_string(type));
  return static_cast<size_t>(bytes);
}

template <typename T>
float asFloat(T value, bool normalized) {
  if constexpr (std::is_integral_v<T>) {
    if (normalized) {
      // Both ends of a signed range stand for -1.
      return std::max(static_cast<float>(value) / static_cast<float>(std::numeric_limits<T>::max()),
                      -1.0f);
    }
  }
  return static_cast<float>(value);
}

/// Elements of `width` values of type T, `stride` bytes apart, to floats, `out_stride` apart.
template <typename T>
void convert(const unsigned char* bytes, size_t stride, size_t count, size_t width, bool normalized,
             float* out, size_t out_stride) {
  if (count == 0) return;  // `out` may be null
  if constexpr (std::is_same_v<T, float>) {
    const size_t row = width * sizeof(float);
    if (out_stride == width && stride == row) {
      std::memcpy(out, bytes, count * row);
      return;
    }
    for (size_t i = 0; i < count; ++i) std::memcpy(out + i * out_stride, bytes + i * stride, row);
    return;
  }
  for (size_t i = 0; i < count; ++i) {
    for (size_t c = 0; c < width; ++c) {
      out[i * out_stride + c] = asFloat(load<T>(bytes + i * stride + c * sizeof(T)), normalized);
    }
  }
}

void convert(const tinygltf::Accessor& accessor, const unsigned char* bytes, size_t stride,
             size_t count, size_t width, float* out, size_t out_stride) {
  const auto run = [&](auto zero) {
    convert<decltype(zero)>(bytes, stride, count, width, accessor.normalized, out, out_stride);
  };
  switch (accessor.componentType) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return run(int8_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return run(uint8_t{});
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return run(int16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return run(uint16_t{});
    case TINYGLTF_COMPONENT_TYPE_INT:
      return run(int32_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return run(uint32_t{});
    case TINYGLTF_COMPONENT_TYPE_DOUBLE:
      return run(double{});
    default:
      return run(float{});
  }
}

uint32_t wholeNumber(const unsigned char* bytes, int type, const std::string& what) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load<uint8_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<uint16_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return load<uint32_t>(bytes);
    default:
      failHere(what + " has indices of component type " + std::to_string(type) +
               "; unsigned bytes, shorts or ints are allowed");
  }
}

void applySparse(const GltfModel& model, const tinygltf::Accessor& accessor, size_t width,
                 const std::string& what, float* out, size_t out_stride) {
  const auto& sparse = accessor.sparse;
  // Signed in one version of tinygltf, unsigned in the next.
  const auto negative = [](auto number) { return static_cast<int64_t>(number) < 0; };
  if (negative(sparse.count) || negative(sparse.indices.byteOffset) ||
      negative(sparse.values.byteOffset)) {
    failHere(what + " has a sparse part of negative size");
  }
  const size_t count = static_cast<size_t>(sparse.count);
  const size_t index_bytes = componentBytes(sparse.indices.componentType, what);
  const size_t value_bytes = componentBytes(accessor.componentType, what);
  const Range indices =
      rangeOf(model, sparse.indices.bufferView, static_cast<size_t>(sparse.indices.byteOffset),
              count, index_bytes, what);
  const Range replaced =
      rangeOf(model, sparse.values.bufferView, static_cast<size_t>(sparse.values.byteOffset), count,
              value_bytes * width, what);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t target =
        wholeNumber(indices.first + i * indices.stride, sparse.indices.componentType, what);
    if (target >= accessor.count) {
      failHere(what + " replaces element " + std::to_string(target) + " of " +
               std::to_string(accessor.count));
    }
    convert(accessor, replaced.first + i * replaced.stride, 0, 1, width, out + target * out_stride,
            out_stride);
  }
}

}  // namespace

size_t accessorWidth(const GltfModel& model, int accessor, const std::string& what) {
  const int width = tinygltf::GetNumComponentsInType(
      static_cast<uint32_t>(accessorAt(model, accessor, what).type));
  return width > 0 ? static_cast<size_t>(width) : 0;
}

size_t accessorCount(const GltfModel& model, int index, const std::string& what) {
  return accessorAt(model, index, what).count;
}

void requireAccessor(const GltfModel& model, int index, size_t width, const std::string& what) {
  const tinygltf::Accessor& accessor = accessorAt(model, index, what);
  const size_t seen = accessorWidth(model, index, what);
  if (seen != width) {
    failHere(what + " has " + std::to_string(seen) + " components; " + std::to_string(width) +
             " are needed");
  }
  const size_t bytes = componentBytes(accessor.componentType, what);
  if (accessor.bufferView >= 0) {
    rangeOf(model, accessor.bufferView, accessor.byteOffset, accessor.count, bytes * width, what);
  }
}

FloatSource::FloatSource(const GltfModel& model, int index, size_t width, const std::string& what)
    : model_(model), accessor_(accessorAt(model, index, what)), width_(width), what_(what) {
  requireAccessor(model, index, width, what);
  if (accessor_.bufferView < 0) return;
  const Range range = rangeOf(model, accessor_.bufferView, accessor_.byteOffset, accessor_.count,
                              componentBytes(accessor_.componentType, what) * width, what);
  first_ = range.first;
  stride_ = range.stride;
}

void FloatSource::readDense(size_t begin, size_t end, float* out, size_t out_stride) const {
  if (first_ != nullptr) {
    convert(accessor_, first_ + begin * stride_, stride_, end - begin, width_, out, out_stride);
    return;
  }
  for (size_t i = 0; i < end - begin; ++i) std::fill_n(out + i * out_stride, width_, 0.0f);
}

bool FloatSource::join(const FloatSource& next) {
  const auto areFloats = [](const FloatSource& source) {
    return source.first_ != nullptr && !source.accessor_.sparse.isSparse &&
           source.accessor_.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT;
  };
  const bool behind = areFloats(*this) && areFloats(next) && next.stride_ == stride_ &&
                      next.accessor_.count == accessor_.count &&
                      next.first_ == first_ + width_ * sizeof(float) &&
                      (width_ + next.width_) * sizeof(float) <= stride_;
  if (behind) width_ += next.width_;
  return behind;
}

void FloatSource::readSparse(float* out, size_t out_stride) const {
  if (accessor_.sparse.isSparse) applySparse(model_, accessor_, width_, what_, out, out_stride);
}

std::vector<float> readFloats(const GltfModel& model, int index, size_t width,
                              const std::string& what) {
  requireAccessor(model, index, width, what);
  std::vector<float> values(accessorAt(model, index, what).count * width);
  const FloatSource source(model, index, width, what);
  source.readDense(0, values.size() / width, values.data(), width);
  source.readSparse(values.data(), width);
  return values;
}

std::vector<uint32_t> readIndices(const GltfModel& model, int index, const std::string& what) {
  const tinygltf::Accessor& accessor = accessorAt(model, index, what);
  const size_t bytes = componentBytes(accessor.componentType, what);
  if (accessorWidth(model, index, what) != 1 || accessor.bufferView < 0 ||
      accessor.sparse.isSparse) {
    failHere(what + " must be plain numbers in a buffer view");
  }
  const Range range =
      rangeOf(model, accessor.bufferView, accessor.byteOffset, accessor.count, bytes, what);
  std::vector<uint32_t> values(accessor.count);
  for (size_t i = 0; i < accessor.count; ++i) {
    values[i] = wholeNumber(range.first + i * range.stride, accessor.componentType, what);
  }
  return values;
}

size_t viewBytes(const GltfModel& model, int view, const std::string& what) {
  rangeOf(model, view, 0, 0, 1, what);
  return model.bufferViews[static_cast<size_t>(view)].byteLength;
}

std::vector<unsigned char> readView(const GltfModel& model, int view, const std::string& what) {
  const Range range = rangeOf(model, view, 0, 0, 1, what);
  return std::vector<unsigned char>(range.first, range.first + viewBytes(model, view, what));
}

}  // namespace stipple::media
