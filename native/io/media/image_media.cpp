// Pictures, whatever reads and writes their formats (picture_file.h): which channels are taken,
// what is too large, and the data's place in the picture.
#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/limits.h"
#include "io/media/media_calls.h"
#include "io/media/picture_file.h"

namespace stipple::media {

namespace {

// 2^28 pixels of four float32 channels are 4 GiB.
constexpr uint64_t kMaxPixels = uint64_t{1} << 28;

/// Which channels of the file become grey, RGB or RGBA.
std::vector<int> chooseChannels(const PictureHead& head) {
  const auto find = [&head](const char* name) {
    const auto found = std::find(head.channels.begin(), head.channels.end(), name);
    return found != head.channels.end() ? static_cast<int>(found - head.channels.begin()) : -1;
  };
  const auto channel_count = static_cast<int>(head.channels.size());
  std::vector<int> chosen = {find("R"), find("G"), find("B")};
  if (chosen[0] < 0 || chosen[1] < 0 || chosen[2] < 0) {
    if (channel_count <= 2) {
      chosen = channel_count == 1 ? std::vector<int>{0} : std::vector<int>{0, 0, 0};
    } else {
      chosen = {0, 1, 2};
    }
  }
  const int alpha = head.alpha_channel >= 0                      ? head.alpha_channel
                    : (channel_count == 2 || channel_count == 4) ? channel_count - 1
                                                                 : -1;
  const bool separate = std::find(chosen.begin(), chosen.end(), alpha) == chosen.end();
  if (alpha >= 0 && alpha < channel_count && separate) {
    if (chosen.size() == 1) chosen = {chosen[0], chosen[0], chosen[0]};
    chosen.push_back(alpha);
  }
  return chosen;
}

/// What the header says, where that is a picture that can be read.
StippleMediaImage describe(const PictureHead& head, const std::string& name) {
  const int64_t window[2] = {head.full_width > 0 ? head.full_width : head.width,
                             head.full_height > 0 ? head.full_height : head.height};
  for (const int64_t side : {window[0], window[1], head.width, head.height}) {
    if (side < 1 || side > 65536) {
      fail(ErrorCode::kFormat, name + " is " + std::to_string(window[0]) + " x " +
                                   std::to_string(window[1]) +
                                   " pixels; each side must be 1 to 65536");
    }
  }
  const auto area = [](int64_t w, int64_t h) { return static_cast<uint64_t>(w * h); };
  if (std::max(area(window[0], window[1]), area(head.width, head.height)) > kMaxPixels ||
      head.channels.empty() || head.depth > 1) {
    fail(ErrorCode::kFormat, name + " is " + std::to_string(window[0]) + " x " +
                                 std::to_string(window[1]) + " pixels; at most " +
                                 std::to_string(kMaxPixels) + " flat pixels can be read");
  }
  StippleMediaImage info{};
  info.width = static_cast<uint32_t>(window[0]);
  info.height = static_cast<uint32_t>(window[1]);
  info.channels = static_cast<uint32_t>(chooseChannels(head).size());
  info.is_display = head.is_floating_point ? 0 : 1;
  info.alpha_is_associated = head.has_straight_alpha ? 0 : 1;
  info.bits = head.value_bytes * 8;
  return info;
}

/// Room for this many floats.
using Allocate = std::function<float*(size_t count)>;

/// Decodes the pixels [height, width, channels] to where `allocate` says.
StippleMediaImage decodeInto(PictureFile& input, const std::string& name, const ImagesSoFar& others,
                             const Allocate& allocate) {
  const PictureHead& head = input.head();
  const StippleMediaImage info = describe(head, name);
  const int64_t window[2] = {info.width, info.height};
  const std::vector<int> channels = chooseChannels(head);
  const int first = *std::min_element(channels.begin(), channels.end());
  const int last = *std::max_element(channels.begin(), channels.end());
  const auto read_channels = static_cast<size_t>(last - first + 1);
  const auto data_floats =
      static_cast<uint64_t>(head.width) * static_cast<uint64_t>(head.height) * read_channels;
  const uint64_t pixel_floats = uint64_t{info.width} * info.height * channels.size();
  requireAllowed(others.pixel_bytes + std::max(data_floats, pixel_floats) * sizeof(float),
                 kImageAllowance, others.encoded_bytes, name,
                 "an image of " + std::to_string(info.width) + " x " + std::to_string(info.height) +
                     " pixels");
  const size_t count = static_cast<size_t>(window[0] * window[1]) * channels.size();
  // Most pictures lie in their files as they are wanted; a copy takes as long as a tenth of
  // decoding.
  bool as_wanted =
      head.x == 0 && head.y == 0 && head.width == window[0] && head.height == window[1];
  for (size_t c = 0; c < channels.size(); ++c) {
    as_wanted = as_wanted && channels[c] == first + static_cast<int>(c);
  }
  if (as_wanted) {
    input.read(first, last + 1, allocate(count));
    return info;
  }

  const size_t width = static_cast<size_t>(head.width);
  const size_t height = static_cast<size_t>(head.height);
  std::vector<float> pixels(width * height * read_channels);
  input.read(first, last + 1, pixels.data());
  float* out = allocate(count);
  std::fill_n(out, count, 0.0f);
  // The data window may be smaller or larger than the picture.
  for (size_t y = 0; y < height; ++y) {
    const int64_t row = head.y + static_cast<int64_t>(y);
    if (row < 0 || row >= window[1]) continue;
    for (size_t x = 0; x < width; ++x) {
      const int64_t column = head.x + static_cast<int64_t>(x);
      if (column < 0 || column >= window[0]) continue;
      const float* from = &pixels[(y * width + x) * read_channels];
      float* to = out + static_cast<size_t>(row * window[0] + column) * channels.size();
      for (size_t c = 0; c < channels.size(); ++c) to[c] = from[channels[c] - first];
    }
  }
  return info;
}

/// Copies bytes of a file from an offset, all inside it.
using ReadAt = std::function<void(uint64_t offset, uint8_t* out, size_t count)>;

/// Refuses a PNG of which a chunk says that it goes on beyond the end: its reader would ask for
/// that much memory, up to 2 GiB, before it looks. Other files are fine. In: size, of the file.
void requireWholeChunks(uint64_t size, const ReadAt& read_at, const std::string& name) {
  constexpr uint64_t kSignature = 8;
  constexpr uint64_t kAround = 12;  // length, type and checksum of a chunk
  std::array<uint8_t, 8> head;
  if (size < head.size()) return;
  read_at(0, head.data(), head.size());
  if (std::memcmp(head.data(), "\x89PNG", 4) != 0) return;
  for (uint64_t at = kSignature; at + kAround <= size;) {
    read_at(at, head.data(), head.size());
    uint64_t length = 0;
    for (size_t i = 0; i < 4; ++i) length = length << 8 | head[i];
    const uint64_t left = size - at - kAround;
    if (length > left) {
      fail(ErrorCode::kFormat, name + " cannot be decoded: a part of it says that it has " +
                                   std::to_string(length) + " bytes, and " + std::to_string(left) +
                                   " are left");
    }
    if (std::memcmp(&head[4], "IEND", 4) == 0) return;
    at += kAround + length;
  }
}

}  // namespace

DecodedImage decodeImageBytes(const std::vector<unsigned char>& bytes, const std::string& name,
                              const ImagesSoFar& others) {
  requireWholeChunks(
      bytes.size(),
      [&bytes](uint64_t at, uint8_t* out, size_t count) { std::copy_n(&bytes[at], count, out); },
      name);
  DecodedImage image;
  image.info = decodeInto(*openPicture(bytes, name), name, others, [&image](size_t count) {
    image.pixels.resize(count);
    return image.pixels.data();
  });
  return image;
}

void stipple_media_image_read(const char* path, StippleMediaImage* image,
                              const StippleMediaSink* sink, StippleMediaStatus* status) {
  guard(path, status, [&] {
    const InputFile file(path);
    requireWholeChunks(
        file.size(),
        [&file](uint64_t at, uint8_t* out, size_t count) { file.readAt(at, out, count); }, path);
    *image = decodeInto(*openPicture(path), path, {0, file.size()}, [sink](size_t count) {
      return static_cast<float*>(
          stipple::media::allocate(*sink, kMediaPixels, count * sizeof(float)));
    });
  });
}

void stipple_media_image_header(const char* path, StippleMediaImage* image,
                                StippleMediaStatus* status) {
  guard(path, status, [&] { *image = describe(openPicture(path)->head(), path); });
}

void stipple_media_png_write(const char* path, const StippleMediaImage* image,
                             const uint8_t* pixels, StippleMediaStatus* status) {
  guard(path, status, [&] { writePng(path, *image, pixels); });
}

void stipple_media_exr_write(const char* path, const StippleMediaImage* image, const float* pixels,
                             StippleMediaStatus* status) {
  guard(path, status, [&] { writeExr(path, *image, pixels); });
}

}  // namespace stipple::media
