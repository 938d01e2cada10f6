// Based on: the SPZ format, github.com/nianticlabs/spz, README (layout and quantities).
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/compression.h"
#include "io/bytes/input_file.h"
#include "io/bytes/little_endian.h"
#include "io/splats/splat_check.h"
#include "io/splats/spz_file.h"
#include "math/half_float.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 8192;
// deflate packs at most 1032 bytes into one.
constexpr uint64_t kGzipRatio = 1032;
// Far above what zstd makes of positions; the bound that other readers put on a lying count.
constexpr uint64_t kZstdRatio = 1024;
// Extension records at the end of an old file: known ones take 12 and 20 bytes.
constexpr size_t kExtensionRoom = size_t{1} << 16;

struct Header {
  uint32_t version = 0;
  uint64_t count = 0;
  int degree = 0;
  unsigned fractional_bits = 0;
  uint8_t flags = 0;
};

class Reader {
 public:
  Reader(ByteVector bytes, const std::string& what, Progress* progress)
      : what_(what), file_bytes_(bytes.size()), progress_(progress), bytes_(std::move(bytes)) {}

  SplatCloud read() {
    if (file_bytes_ < kSpzOldHeaderBytes) {
      failHere("holds " + std::to_string(file_bytes_) + " bytes; a header takes " +
               std::to_string(kSpzOldHeaderBytes));
    }
    advance(progress_, 0.1, "Reading splats");
    if (loadLittleEndian<uint32_t>(bytes_.data()) == kSpzMagic) {
      if (loadLittleEndian<uint32_t>(&bytes_[4]) >= 4) {
        readStreams();
      } else {
        readPlain(bytes_.data(), bytes_.size());
      }
    } else if (bytes_[0] == 0x1f && bytes_[1] == 0x8b) {
      readGzip();
    } else {
      failHere("starts with neither 'NGSP' nor a gzip header (1f 8b at byte 0)");
    }
    return std::move(cloud_);
  }

 private:
  [[noreturn]] void failHere(const std::string& what) const {
    fail(ErrorCode::kFormat, what_ + " is not a valid SPZ file: it " + what);
  }

  /// In: at least kSpzOldHeaderBytes bytes. All versions agree on these fields.
  void readHeader(const uint8_t* bytes) {
    if (loadLittleEndian<uint32_t>(bytes) != kSpzMagic) {
      failHere("does not have 'NGSP' at byte 0 of its unpacked content");
    }
    header_.version = loadLittleEndian<uint32_t>(bytes + 4);
    header_.count = loadLittleEndian<uint32_t>(bytes + 8);
    const unsigned degree = bytes[12];
    header_.fractional_bits = bytes[13];
    header_.flags = bytes[14];
    if (header_.version < 1 || header_.version > kSpzNewestVersion) {
      fail(ErrorCode::kUnsupported, what_ + " is SPZ of version " +
                                        std::to_string(header_.version) + "; 1 to 4 can be read");
    }
    if (degree > static_cast<unsigned>(kMaxShDegree)) {
      failHere("claims harmonics of degree " + std::to_string(degree) +
               " at byte 12; 0 to 4 is allowed");
    }
    header_.degree = static_cast<int>(degree);
    if (header_.fractional_bits > 30) {
      failHere("claims " + std::to_string(header_.fractional_bits) +
               " fractional bits at byte 13; at most 30 are allowed");
    }
  }

  uint64_t arrayBytes(size_t array) const {
    return header_.count * spzBytesPerSplat(array, header_.version, header_.degree);
  }
  uint64_t allArrayBytes() const {
    uint64_t total = 0;
    for (size_t array = 0; array < kSpzArrayCount; ++array) total += arrayBytes(array);
    return total;
  }

  /// A lying count is refused before anything is allocated for it. In: bytes that the splats unpack
  /// to, and how many of them a byte of the file can hold.
  void requireRoom(uint64_t unpacked, uint64_t ratio) const {
    requireAllowedSplats(header_.count, header_.degree, file_bytes_, what_);
    const uint64_t possible = file_bytes_ * ratio;
    if (unpacked > possible) {
      failHere("claims " + std::to_string(header_.count) + " splats, " + std::to_string(unpacked) +
               " bytes unpacked; its " + std::to_string(file_bytes_) + " bytes can hold at most " +
               std::to_string(possible));
    }
  }

  void readGzip() {
    std::array<uint8_t, kSpzOldHeaderBytes> start;
    const size_t got = unpackBytes(Compression::kGzip, bytes_.data(), bytes_.size(), start.data(),
                                   start.size(), what_);
    if (got < start.size()) {
      failHere("unpacks to " + std::to_string(got) + " bytes; a header takes " +
               std::to_string(start.size()));
    }
    readHeader(start.data());
    requireRoom(allArrayBytes(), kGzipRatio);
    const uint64_t wanted = kSpzOldHeaderBytes + allArrayBytes() + kExtensionRoom;
    ByteVector plain(static_cast<size_t>(wanted));
    plain.resize(unpackBytes(Compression::kGzip, bytes_.data(), bytes_.size(), plain.data(),
                             plain.size(), what_));
    advance(progress_, 0.6, "Reading splats");
    bytes_ = ByteVector();
    readPlain(plain.data(), plain.size());
  }

  /// The unpacked content of versions 1 to 3: header, arrays, extensions.
  void readPlain(const uint8_t* bytes, size_t size) {
    readHeader(bytes);
    if (header_.version > 3) failHere("holds version 4 in a gzip stream, which is of 1 to 3");
    const uint64_t needed = kSpzOldHeaderBytes + allArrayBytes();
    if (size < needed) {
      failHere("is truncated: " + std::to_string(header_.count) + " splats need " +
               std::to_string(needed) + " bytes unpacked, it holds " + std::to_string(size));
    }
    std::array<const uint8_t*, kSpzArrayCount> arrays;
    const uint8_t* next = bytes + kSpzOldHeaderBytes;
    for (size_t array = 0; array < kSpzArrayCount; ++array) {
      arrays[array] = next;
      next += arrayBytes(array);
    }
    if ((header_.flags & kSpzHasExtensions) != 0) {
      readExtensions(next, size - static_cast<size_t>(needed), needed);
    }
    decode(arrays);
  }

  void readStreams() {
    if (bytes_.size() < kSpzHeaderBytes) {
      failHere("is truncated: a header of version 4 takes " + std::to_string(kSpzHeaderBytes) +
               " bytes, it holds " + std::to_string(bytes_.size()));
    }
    readHeader(bytes_.data());
    requireRoom(arrayBytes(0), kZstdRatio);
    const size_t stream_count = bytes_[15];
    const uint64_t table = loadLittleEndian<uint32_t>(&bytes_[16]);
    const uint64_t table_end = table + stream_count * kSpzStreamEntryBytes;
    if (table < kSpzHeaderBytes || table_end > bytes_.size()) {
      failHere("places its table of " + std::to_string(stream_count) + " streams at bytes " +
               std::to_string(table) + " to " + std::to_string(table_end) + "; 32 to " +
               std::to_string(bytes_.size()) + " is allowed");
    }
    struct Stream {
      size_t array, offset, size;
    };
    std::vector<Stream> streams;
    uint64_t offset = table_end;
    size_t used = 0;
    for (size_t array = 0; array < kSpzArrayCount; ++array) {
      // Arrays without bytes have no stream; a stream without bytes is passed over.
      if (arrayBytes(array) == 0 && used == stream_count) continue;
      if (used == stream_count) {
        failHere("has " + std::to_string(stream_count) + " streams at byte 15; array " +
                 std::to_string(array) + " of 6 has none");
      }
      const uint8_t* entry = &bytes_[static_cast<size_t>(table) + used * kSpzStreamEntryBytes];
      const uint64_t packed = loadLittleEndian<uint64_t>(entry);
      const uint64_t plain = loadLittleEndian<uint64_t>(entry + 8);
      if (arrayBytes(array) == 0 && plain != 0) continue;
      if (plain != arrayBytes(array)) {
        failHere("says that stream " + std::to_string(used) + " unpacks to " +
                 std::to_string(plain) + " bytes; " + std::to_string(header_.count) +
                 " splats need " + std::to_string(arrayBytes(array)));
      }
      if (packed > bytes_.size() - offset) {
        failHere("is truncated: stream " + std::to_string(used) + " takes " +
                 std::to_string(packed) + " bytes from byte " + std::to_string(offset) + ", " +
                 std::to_string(bytes_.size() - offset) + " are left");
      }
      if (plain > 0) {
        streams.push_back({array, static_cast<size_t>(offset), static_cast<size_t>(packed)});
      }
      offset += packed;
      ++used;
    }
    if ((header_.flags & kSpzHasExtensions) != 0) {
      readExtensions(&bytes_[kSpzHeaderBytes], static_cast<size_t>(table) - kSpzHeaderBytes,
                     kSpzHeaderBytes);
    }
    std::array<ByteVector, kSpzArrayCount> plain;
    parallelFor(streams.size(), 1, [&](size_t begin, size_t end) {
      for (size_t s = begin; s < end; ++s) {
        const Stream& stream = streams[s];
        ByteVector& out = plain[stream.array];
        out.resize(static_cast<size_t>(arrayBytes(stream.array)));
        const std::string what =
            what_ + ": stream " + std::to_string(s) + " at byte " + std::to_string(stream.offset);
        const size_t got = unpackBytes(Compression::kZstd, &bytes_[stream.offset], stream.size,
                                       out.data(), out.size(), what);
        if (got != out.size()) {
          fail(ErrorCode::kFormat, what + " unpacks to " + std::to_string(got) + " bytes; " +
                                       std::to_string(out.size()) + " are needed");
        }
      }
    });
    advance(progress_, 0.6, "Reading splats");
    bytes_ = ByteVector();
    std::array<const uint8_t*, kSpzArrayCount> arrays;
    for (size_t array = 0; array < kSpzArrayCount; ++array) arrays[array] = plain[array].data();
    decode(arrays);
  }

  /// Records of type, length and content; the ones that are not known are passed over.
  void readExtensions(const uint8_t* bytes, size_t size, uint64_t file_offset) {
    size_t at = 0;
    while (size - at >= 8) {
      const uint32_t type = loadLittleEndian<uint32_t>(bytes + at);
      const uint64_t length = loadLittleEndian<uint32_t>(bytes + at + 4);
      const std::string place = "extension at byte " + std::to_string(file_offset + at);
      if (length > size - at - 8) {
        failHere("is damaged: its " + place + " claims " + std::to_string(length) + " bytes, " +
                 std::to_string(size - at - 8) + " are left");
      }
      if (type == kSpzCoordinateSystem) {
        const uint32_t frame = length == 4 ? loadLittleEndian<uint32_t>(bytes + at + 8) : ~0u;
        if (frame > kLastFrame) {
          failHere("is damaged: its " + place +
                   " names no coordinate system; one number of 4 bytes"
                   ", 1 to 16, is expected");
        }
        // 0 is a writer's slip, for which the format's own frame is taken.
        if (frame != 0) frame_ = static_cast<Frame>(frame);
      }
      at += 8 + static_cast<size_t>(length);
    }
  }

  void decode(const std::array<const uint8_t*, kSpzArrayCount>& arrays) {
    cloud_.sh_degree = header_.degree;
    cloud_.antialias =
        (header_.flags & kSpzAntialiased) != 0 ? Antialias::kMip : Antialias::kClassic;
    cloud_.frame = frame_;
    cloud_.resize(static_cast<size_t>(header_.count));
    for (size_t byte = 0; byte < 256; ++byte) {
      const double value = static_cast<double>(byte);
      opacity_of_[byte] = static_cast<float>(value / 255.0);
      scale_of_[byte] = static_cast<float>(std::exp(value / 16.0 - 10.0));
      colour_of_[byte] = static_cast<float>((value / 255.0 - 0.5) / kSpzColourScale);
      harmonic_of_[byte] = static_cast<float>((value - 128.0) / 128.0);
    }
    parallelFor(cloud_.size(), kGrain,
                [&](size_t begin, size_t end) { decodeRows(arrays, begin, end); });
    advance(progress_, 1.0, "Reading splats");
  }

  void decodeRows(const std::array<const uint8_t*, kSpzArrayCount>& arrays, size_t begin,
                  size_t end) {
    if (header_.version == 1) {
      decodeHalfPositions(arrays[0], begin, end);
    } else {
      const float step = std::ldexp(1.0f, -static_cast<int>(header_.fractional_bits));
      for (size_t i = begin * 3; i < end * 3; ++i) {
        const uint8_t* p = arrays[0] + i * 3;
        // The three bytes as the upper ones of a signed number, so that the shift back keeps the
        // sign.
        const uint32_t upper = static_cast<uint32_t>(p[0]) << 8 |
                               static_cast<uint32_t>(p[1]) << 16 |
                               static_cast<uint32_t>(p[2]) << 24;
        cloud_.positions[i] = static_cast<float>(static_cast<int32_t>(upper) >> 8) * step;
      }
    }
    for (size_t i = begin; i < end; ++i) cloud_.opacities[i] = opacity_of_[arrays[1][i]];
    for (size_t i = begin * 3; i < end * 3; ++i) cloud_.scales[i] = scale_of_[arrays[3][i]];
    for (size_t i = begin; i < end; ++i) {
      if (header_.version >= 3) {
        decodeSmallestThree(arrays[4] + i * 4, &cloud_.rotations[i * 4]);
      } else {
        decodeFirstThree(arrays[4] + i * 3, &cloud_.rotations[i * 4]);
      }
    }
    const size_t stride = cloud_.shStride();
    for (size_t i = begin; i < end; ++i) {
      float* sh = &cloud_.sh[i * stride];
      for (size_t c = 0; c < 3; ++c) sh[c] = colour_of_[arrays[2][i * 3 + c]];
      const uint8_t* rest = arrays[5] + i * (stride - 3);
      for (size_t k = 3; k < stride; ++k) sh[k] = harmonic_of_[rest[k - 3]];
    }
  }

  void decodeHalfPositions(const uint8_t* bytes, size_t begin, size_t end) {
    for (size_t i = begin * 3; i < end * 3; ++i) {
      const float value = halfToFloat(loadLittleEndian<uint16_t>(bytes + i * 2));
      if (!std::isfinite(value)) {
        failHere("is damaged: the position of splat " + std::to_string(i / 3) +
                 " is not a finite number");
      }
      cloud_.positions[i] = value;
    }
  }

  /// x, y, z as bytes; w >= 0 is what is left of the unit length.
  static void decodeFirstThree(const uint8_t* bytes, float* q) {
    double squares = 0;
    for (size_t k = 0; k < 3; ++k) {
      const double value = static_cast<double>(bytes[k]) / 127.5 - 1.0;
      q[1 + k] = static_cast<float>(value);
      squares += value * value;
    }
    q[0] = static_cast<float>(std::sqrt(std::max(0.0, 1.0 - squares)));
    if (squares <= 1.0) return;
    for (size_t k = 1; k < 4; ++k)
      q[k] = static_cast<float>(static_cast<double>(q[k]) / std::sqrt(squares));
  }

  /// Index of the largest of x, y, z, w in 2 bits, then the other three, each a sign and 9 bits of
  /// magnitude times sqrt(1/2) / 511.
  static void decodeSmallestThree(const uint8_t* bytes, float* q) {
    uint32_t packed = loadLittleEndian<uint32_t>(bytes);
    const size_t largest = packed >> 30;
    double squares = 0;
    for (size_t k = 4; k-- > 0;) {
      if (k == largest) continue;
      const double magnitude = static_cast<double>(packed & 511) * (std::sqrt(0.5) / 511.0);
      const double value = (packed & 512) != 0 ? -magnitude : magnitude;
      packed >>= 10;
      squares += value * value;
      q[(k + 1) % 4] = static_cast<float>(value);
    }
    // Three magnitudes at their ends are longer than a unit quaternion.
    q[(largest + 1) % 4] = static_cast<float>(std::sqrt(std::max(0.0, 1.0 - squares)));
    if (squares <= 1.0) return;
    for (size_t k = 0; k < 4; ++k)
      q[k] = static_cast<float>(static_cast<double>(q[k]) / std::sqrt(squares));
  }

  std::string what_;
  uint64_t file_bytes_;
  Progress* progress_;
  ByteVector bytes_;
  Header header_;
  Frame frame_ = Frame::kRUB;
  SplatCloud cloud_;
  std::array<float, 256> opacity_of_, scale_of_, colour_of_, harmonic_of_;
};

}  // namespace

bool startsAsSpz(const SplatFileStart& start) {
  return start.bytes.rfind("NGSP", 0) == 0 ||
         (start.bytes.rfind("\x1f\x8b", 0) == 0 && start.name.size() > 4 &&
          start.name.compare(start.name.size() - 4, 4, ".spz") == 0);
}

size_t spzBytesPerSplat(size_t array, uint32_t version, int degree) {
  switch (array) {
    case 0:
      return version == 1 ? 6 : 9;
    case 1:
      return 1;
    case 4:
      return version >= 3 ? 4 : 3;
    case 5:
      return (shCoefficientCount(degree) - 1) * 3;
    default:
      return 3;
  }
}

SplatCloud readSpzSplats(const std::string& path, Progress* progress) {
  const InputFile file(path);
  ByteVector bytes(static_cast<size_t>(file.size()));
  file.readAt(0, bytes.data(), bytes.size());
  return readSpzBytes(std::move(bytes), path, progress);
}

SplatCloud readSpzBytes(ByteVector bytes, const std::string& what, Progress* progress) {
  return Reader(std::move(bytes), what, progress).read();
}

}  // namespace stipple
