#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace tinygltf {
struct Accessor;
}  // namespace tinygltf

namespace stipple::media {

struct GltfModel;

/// Values of an accessor as float: normalised integers become -1..1 or 0..1, sparse entries replace
/// what they name. Every range is checked against its buffer.
/// In: width, components per element that are needed; accessors with another number are kFormat.
/// Out: [count, width].
std::vector<float> readFloats(const GltfModel& model, int accessor, size_t width,
                              const std::string& what);

/// An accessor that is read in pieces, from any thread: first the pieces of its dense part, then
/// its sparse part once. Refuses what readFloats refuses when it is made.
class FloatSource {
 public:
  FloatSource(const GltfModel& model, int accessor, size_t width, const std::string& what);
  /// Elements [begin, end) to `out`, `out_stride` floats apart.
  void readDense(size_t begin, size_t end, float* out, size_t out_stride) const;
  /// Takes in the components of `next` where they lie as floats behind this one's, row by row, so
  /// that both are read at once. False, and nothing done, where they do not.
  bool join(const FloatSource& next);
  size_t width() const { return width_; }
  /// In: out, where element 0 is.
  void readSparse(float* out, size_t out_stride) const;

 private:
  const GltfModel& model_;
  const tinygltf::Accessor& accessor_;
  size_t width_;
  std::string what_;
  const unsigned char* first_ = nullptr;  ///< null: all zeros
  size_t stride_ = 0;
};

/// Elements of an accessor. Errors: kFormat if there is no such accessor.
size_t accessorCount(const GltfModel& model, int accessor, const std::string& what);

/// Refuses accessors that readFloats refuses, before anything is allocated. One without a buffer
/// view is all zeros: the caller bounds its count.
void requireAccessor(const GltfModel& model, int accessor, size_t width, const std::string& what);

/// Components per element of an accessor. Errors: kFormat if there is no such accessor.
size_t accessorWidth(const GltfModel& model, int accessor, const std::string& what);

/// Vertex indices of a primitive.
std::vector<uint32_t> readIndices(const GltfModel& model, int accessor, const std::string& what);

/// How many bytes a buffer view has, all inside its buffer.
size_t viewBytes(const GltfModel& model, int view, const std::string& what);

/// The bytes of a buffer view.
std::vector<unsigned char> readView(const GltfModel& model, int view, const std::string& what);

}  // namespace stipple::media
