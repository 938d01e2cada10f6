#include "io/media/decoders/exr_layout.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfPartType.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <utility>

#include "base/error.h"

namespace stipple::media {

namespace {

/// What channels are sorted by: the layer, and in it the place of R, G, B and A, before all others.
std::pair<std::string, size_t> rankOf(const std::string& name) {
  constexpr std::array<const char*, 4> kFirst = {"R", "G", "B", "A"};
  const size_t dot = name.rfind('.');
  const std::string layer = dot == std::string::npos ? std::string() : name.substr(0, dot);
  const std::string last = dot == std::string::npos ? name : name.substr(dot + 1);
  return {layer,
          static_cast<size_t>(std::find(kFirst.begin(), kFirst.end(), last) - kFirst.begin())};
}

}  // namespace

ExrStream::ExrStream(const std::string& path)
    : bytes(std::filesystem::path(path), std::ios::binary), stream(bytes, path.c_str()) {}

std::vector<ExrChannel> exrChannels(const Imf::Header& header, const std::string& name) {
  if (header.hasType() && (header.type() == Imf::DEEPSCANLINE || header.type() == Imf::DEEPTILE)) {
    fail(ErrorCode::kUnsupported, name + " holds deep pixels; flat ones are read");
  }
  std::vector<ExrChannel> channels;
  const Imf::ChannelList& list = header.channels();
  for (auto at = list.begin(); at != list.end(); ++at) {
    if (at.channel().xSampling != 1 || at.channel().ySampling != 1) {
      fail(ErrorCode::kUnsupported,
           name + " holds the channel '" + at.name() + "' on a coarser grid; full ones are read");
    }
    channels.push_back({at.name(), at.channel().type});
  }
  std::stable_sort(channels.begin(), channels.end(), [](const ExrChannel& a, const ExrChannel& b) {
    return rankOf(a.name) < rankOf(b.name);
  });
  return channels;
}

PictureHead exrWindows(const Imf::Header& header, const std::string& name) {
  const Imath::Box2i& data = header.dataWindow();
  const Imath::Box2i& display = header.displayWindow();
  PictureHead head;
  const auto side = [](int first, int last) { return int64_t{last} - first + 1; };
  head.width = side(data.min.x, data.max.x);
  head.height = side(data.min.y, data.max.y);
  head.x = int64_t{data.min.x} - display.min.x;
  head.y = int64_t{data.min.y} - display.min.y;
  head.full_width = side(display.min.x, display.max.x);
  head.full_height = side(display.min.y, display.max.y);
  for (const int64_t length : {head.width, head.height, head.full_width, head.full_height}) {
    if (length < 1 || length > 65536) {
      fail(ErrorCode::kFormat, name + " is " + std::to_string(head.full_width) + " x " +
                                   std::to_string(head.full_height) +
                                   " pixels; each side must be 1 to 65536");
    }
  }
  return head;
}

}  // namespace stipple::media
