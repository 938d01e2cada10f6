#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "data/tensor_table.h"
#include "io/bytes/input_file.h"

namespace stipple {

/// One tensor of a safetensors file: row-major, little-endian.
struct SafeTensor {
  std::string dtype;  ///< F32, F64, U64, ...
  std::vector<uint64_t> shape;
  uint64_t offset = 0;  ///< first byte in the file
  uint64_t bytes = 0;
};

/// A tensor as it lies in its file, of whatever type: for carrying it to another file.
struct CarriedTensor {
  std::string dtype;
  std::vector<uint64_t> shape;
  std::vector<uint8_t> bytes;
};

/// Opens a safetensors file and checks its header: every tensor lies inside the file, apart from
/// all others, and has the bytes that its shape and type ask for.
/// Errors: kIo, kFormat.
class SafeTensorsReader {
 public:
  explicit SafeTensorsReader(const std::string& path);

  const std::map<std::string, std::string>& metadata() const { return metadata_; }
  const std::map<std::string, SafeTensor>& tensors() const { return tensors_; }
  const std::string& path() const { return file_.path(); }
  /// The whole file in memory; tensors lie at their offsets (InputFile::map).
  std::shared_ptr<const uint8_t> map() const { return file_.map(); }
  /// Values of a tensor. In: width, the last sizes of its shape multiplied; the first is free.
  /// Errors: kFormat where the tensor is missing or of another type or shape.
  std::vector<float> readFloats(const std::string& name, uint64_t width) const;
  std::vector<uint32_t> readUint32s(const std::string& name, uint64_t width) const;
  std::vector<uint64_t> readUint64s(const std::string& name, uint64_t width) const;
  /// A tensor of one of the types that Tensor has, whatever its shape. Errors: kFormat.
  Tensor readTensor(const std::string& name) const;
  /// Whether the bytes of the file are those that SafeTensorsWriter::addChecksum() saw. In:
  /// needs_one, whether a file without a checksum is wrong. Reads the whole file. Errors: kIo.
  bool checksumIsRight(bool needs_one) const;
  /// The tensors that nobody has read yet, but for those that is_left accepts, where it is given.
  std::map<std::string, CarriedTensor> readOthers(
      const std::function<bool(const std::string& name)>& is_left = {}) const;

 private:
  template <typename T>
  std::vector<T> readValues(const SafeTensor& tensor) const;
  const SafeTensor& require(const std::string& name, const char* dtype, uint64_t width) const;

  InputFile file_;
  std::map<std::string, std::string> metadata_;
  std::map<std::string, SafeTensor> tensors_;
  mutable std::set<std::string> read_;
};

/// Collects tensors, then writes them in the order of their names. The arrays stay the caller's and
/// must live until `write`.
class SafeTensorsWriter {
 public:
  void setMetadata(const std::string& key, const std::string& value) { metadata_[key] = value; }
  void add(const std::string& name, const std::vector<float>& values, uint64_t width);
  void add(const std::string& name, const std::vector<uint32_t>& values, uint64_t width);
  void add(const std::string& name, const std::vector<uint64_t>& values, uint64_t width);
  void add(const std::string& name, const Tensor& tensor);
  /// Adds a tensor whose values are fetched when it is written, so that not all are in memory. In:
  /// like: of the same type and shape; values, which may be called more than once: the tensor.
  void addLater(const std::string& name, const Tensor& like, std::function<const Tensor&()> values);
  /// Writes a tensor as it is, where none of this name has been added.
  void carry(const std::string& name, const CarriedTensor& tensor);
  /// Writes metadata where the key has no value yet.
  void carryMetadata(const std::string& key, const std::string& value) {
    metadata_.emplace(key, value);
  }
  /// Adds a number to the metadata that a change of any byte of the file, its own included, makes
  /// wrong.
  void addChecksum();
  /// Errors: kIo; kInvalidArgument for values that are fetched and differ from their shape; the old
  /// file stays.
  void write(const std::string& path) const;

 private:
  struct Entry {
    std::string dtype;
    std::vector<uint64_t> shape;
    const void* data;
    size_t bytes;
    std::function<const Tensor&()> fetch = {};  ///< in place of data

    /// Errors: kInvalidArgument.
    const void* values(const std::string& name) const;
  };
  void addEntry(const std::string& name, const char* dtype, uint64_t width, const void* data,
                size_t value_bytes, size_t count);

  std::map<std::string, std::string> metadata_;
  std::map<std::string, Entry> entries_;
  bool has_checksum_ = false;
};

}  // namespace stipple
