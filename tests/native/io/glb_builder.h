#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace stipple {

/// Puts a GLB file together byte by byte: accessors are added with their data, the rest of the JSON
/// is the test's own text.
class GlbBuilder {
 public:
  /// Adds data as a buffer view; returns its index. In: stride, bytes between elements; 0: none
  /// said.
  int addView(const std::string& bytes, int stride = 0) {
    while (data_.size() % 4 != 0) data_.push_back('\0');
    if (!views_.empty()) views_ += ",";
    views_ += "{\"buffer\":0,\"byteOffset\":" + std::to_string(data_.size());
    views_ += ",\"byteLength\":" + std::to_string(bytes.size());
    if (stride > 0) views_ += ",\"byteStride\":" + std::to_string(stride);
    views_ += "}";
    data_ += bytes;
    return view_count_++;
  }

  /// Adds an accessor of a JSON text; returns its index.
  int addAccessor(const std::string& json) {
    if (!accessors_.empty()) accessors_ += ",";
    accessors_.append("{").append(json).append("}");
    return accessor_count_++;
  }

  /// In: type, "VEC3" and the like; code, the component type's number; width of an element.
  template <typename T>
  int add(const std::vector<T>& values, const char* type, int code, size_t width,
          const std::string& more = "") {
    const int view = addView(
        std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)));
    return addAccessor("\"bufferView\":" + std::to_string(view) +
                       ",\"componentType\":" + std::to_string(code) + ",\"count\":" +
                       std::to_string(values.size() / width) + ",\"type\":\"" + type + "\"" + more);
  }
  int addFloats(const std::vector<float>& values, size_t width) {
    const char* kTypes[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    return add(values, kTypes[width], 5126, width);
  }
  int addIndices(const std::vector<uint16_t>& values) { return add(values, "SCALAR", 5123, 1); }

  /// In: rest, the JSON of nodes, meshes, materials...
  std::string json(const std::string& rest, const std::string& buffer_uri = "") const {
    std::string text = "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":";
    text.append(std::to_string(data_.size()));
    if (!buffer_uri.empty()) text.append(",\"uri\":\"").append(buffer_uri).append("\"");
    text.append("}],\"bufferViews\":[").append(views_);
    text.append("],\"accessors\":[").append(accessors_);
    return text.append("],").append(rest).append("}");
  }
  const std::string& data() const { return data_; }

  std::string glb(const std::string& rest) const {
    std::string text = json(rest);
    while (text.size() % 4 != 0) text.push_back(' ');
    std::string binary = data_;
    while (binary.size() % 4 != 0) binary.push_back('\0');
    const auto number = [](size_t value) {
      const auto word = static_cast<uint32_t>(value);
      std::string bytes(4, '\0');
      std::memcpy(bytes.data(), &word, 4);
      return bytes;
    };
    return "glTF" + number(2) + number(28 + text.size() + binary.size()) + number(text.size()) +
           "JSON" + text + number(binary.size()) + std::string("BIN\0", 4) + binary;
  }

 private:
  std::string views_;
  std::string accessors_;
  std::string data_;
  int view_count_ = 0;
  int accessor_count_ = 0;
};

}  // namespace stipple
