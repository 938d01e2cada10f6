#include "io/image_channels.h"

#include <algorithm>

#include "io/bytes/input_file.h"
#include "io/media_library.h"

namespace stipple {

namespace {

/// 2^28 pixels of four channels: what any image may take.
constexpr uint64_t kMaxBytes = uint64_t{4} << 30;

/// What the media library delivers.
struct Delivery {
  std::vector<StippleMediaChannel> shapes;
  std::string names;
  std::vector<ImageChannel> channels;

  void* take(uint32_t array, uint64_t bytes) {
    const auto size = static_cast<size_t>(bytes);
    if (array == kMediaChannels) {
      shapes.resize(size / sizeof(StippleMediaChannel));
      channels.resize(shapes.size());
      return shapes.data();
    }
    if (array == kMediaChannelNames) {
      names.resize(size);
      return names.data();
    }
    const size_t index = array - kMediaChannelPlanes;
    if (index >= channels.size()) return nullptr;
    channels[index].values.resize(size / sizeof(float));
    return channels[index].values.data();
  }

  void finish() {
    size_t at = 0;
    for (size_t i = 0; i < channels.size(); ++i) {
      channels[i].name = names.substr(at, shapes[i].name_bytes);
      channels[i].width = shapes[i].width;
      channels[i].height = shapes[i].height;
      at += shapes[i].name_bytes;
    }
  }
};

}  // namespace

std::vector<ImageChannel> readImageChannels(const std::string& path, uint64_t limit_bytes) {
  // Names a missing or unreadable file in the words of every reader.
  { const InputFile file(path); }
  Delivery delivery;
  const MediaSink sink(
      [&delivery](uint32_t array, uint64_t bytes) { return delivery.take(array, bytes); });
  const StippleMediaTable& media = mediaTable();
  callMedia([&](StippleMediaStatus* status) {
    media.exr_channels_read(path.c_str(), std::min(limit_bytes, kMaxBytes), sink.get(), status);
  });
  delivery.finish();
  return std::move(delivery.channels);
}

}  // namespace stipple
