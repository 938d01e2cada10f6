// Based on: the file format of OpenVDB 10 (openvdb/io/Archive.cc and GridDescriptor.cc).
#include "io/media/volume_header.h"

#include <array>

#include "base/error.h"
#include "io/bytes/little_endian.h"

namespace stipple::media {

namespace {

constexpr uint32_t kMagic = 0x56444220;  // " BDV"
constexpr uint32_t kOldestVersion = 222;
constexpr size_t kUuidBytes = 36;
constexpr char kSuffixMark = '\x1e';  // in front of a number that tells equal names apart
constexpr char kHalfSuffix[] = "_HalfFloat";
// Names of grids, types and metadata; real ones have less than a hundred letters.
constexpr uint32_t kMaxNameBytes = 65536;

/// Reads one thing after the other.
class Cursor {
 public:
  explicit Cursor(const InputFile& file) : file_(file) {}

  uint64_t offset() const { return offset_; }

  void seek(uint64_t offset) {
    if (offset > file_.size()) {
      fail(ErrorCode::kFormat, file_.path() + " is damaged: it names byte " +
                                   std::to_string(offset) + ", it holds " +
                                   std::to_string(file_.size()));
    }
    offset_ = offset;
  }

  template <typename T>
  T number() {
    std::array<uint8_t, sizeof(T)> bytes;
    file_.readAt(offset_, bytes.data(), bytes.size());
    offset_ += bytes.size();
    return loadLittleEndian<T>(bytes.data());
  }

  void skip(uint64_t bytes) {
    if (bytes > file_.size() - offset_) seek(UINT64_MAX);
    offset_ += bytes;
  }

  std::string name() {
    const auto length = number<uint32_t>();
    if (length > kMaxNameBytes) {
      fail(ErrorCode::kFormat, file_.path() + " is damaged: a name at byte " +
                                   std::to_string(offset_) + " has " + std::to_string(length) +
                                   " bytes; at most " + std::to_string(kMaxNameBytes) +
                                   " are allowed");
    }
    std::string text(length, '\0');
    file_.readAt(offset_, text.data(), text.size());
    offset_ += length;
    return text;
  }

  void skipMetadata() {
    for (auto count = number<uint32_t>(); count > 0; --count) {
      name();
      name();  // of its type
      skip(number<uint32_t>());
    }
  }

 private:
  const InputFile& file_;
  uint64_t offset_ = 0;
};

/// Takes an extension off a text. False where it has another.
bool takeSuffix(std::string& text, const std::string& suffix) {
  if (text.size() < suffix.size() ||
      text.compare(text.size() - suffix.size(), suffix.size(), suffix) != 0) {
    return false;
  }
  text.resize(text.size() - suffix.size());
  return true;
}

}  // namespace

VolumeHeader readVolumeHeader(const InputFile& file) {
  Cursor at(file);
  if (file.size() < sizeof(uint64_t) || at.number<uint64_t>() != kMagic) {
    fail(ErrorCode::kFormat, file.path() + " is not an OpenVDB file: it does not start as one");
  }
  VolumeHeader header;
  header.file_version = at.number<uint32_t>();
  header.library_major = at.number<uint32_t>();
  header.library_minor = at.number<uint32_t>();
  const bool has_offsets = at.number<uint8_t>() != 0;
  if (header.file_version < kOldestVersion || !has_offsets) {
    fail(ErrorCode::kUnsupported,
         file.path() + (has_offsets ? " is an OpenVDB file of version " +
                                          std::to_string(header.file_version) +
                                          "; 222 and later can be read"
                                    : std::string(" was written as a stream, without the places "
                                                  "of its grids; files with them can be read")));
  }
  at.skip(kUuidBytes);
  at.skipMetadata();
  for (auto count = at.number<uint32_t>(); count > 0; --count) {
    std::string name = at.name();
    name = name.substr(0, name.find(kSuffixMark));
    VolumeGridPlace place;
    place.type = at.name();
    place.is_half = takeSuffix(place.type, kHalfSuffix);
    const std::string tree_of = at.name();
    const uint64_t begin = at.number<uint64_t>();
    place.blocks = at.number<uint64_t>();
    const uint64_t end = at.number<uint64_t>();
    if (begin < at.offset() || end < begin) at.seek(UINT64_MAX);
    if (!tree_of.empty()) {
      fail(ErrorCode::kUnsupported, file.path() + ": the grid '" + name.substr(0, 80) +
                                        "' shares the tree of another; one of its own is needed");
    }
    at.seek(begin);
    place.compression = at.number<uint32_t>();
    at.skipMetadata();
    place.transform = at.offset();
    // The name of its kind, which OpenVDB reads again.
    at.name();
    header.grids.emplace(name, place);
    at.seek(end);
  }
  return header;
}

}  // namespace stipple::media
