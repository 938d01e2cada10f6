// The channels of EXR files through OpenImageIO.
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/limits.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

/// Rows that are read at once: as many as the largest blocks of EXR hold. A file that is cut off is
/// found out before much memory is touched.
constexpr int kBandRows = 256;
constexpr int kMaxSide = 65536;

/// One part of a file.
struct Part {
  OIIO::ImageSpec spec;
  size_t first_plane;  ///< of the file's
};

/// What the headers of a file say.
class Layout {
 public:
  Layout(OIIO::ImageInput& input, const std::string& name) : name_(name) {
    for (int part = 0; input.seek_subimage(part, 0); ++part) add(input.spec());
  }

  const std::vector<Part>& parts() const { return parts_; }
  const std::vector<StippleMediaChannel>& channels() const { return channels_; }
  const std::string& names() const { return names_; }
  uint64_t planeBytes() const { return plane_bytes_; }

 private:
  void add(const OIIO::ImageSpec& spec) {
    if (spec.deep) fail(ErrorCode::kUnsupported, name_ + " holds deep pixels; flat ones are read");
    for (const int side : {spec.full_width, spec.full_height, spec.width, spec.height}) {
      if (side < 1 || side > kMaxSide) {
        fail(ErrorCode::kFormat, name_ + " is " + std::to_string(spec.full_width) + " x " +
                                     std::to_string(spec.full_height) +
                                     " pixels; each side must be 1 to " + std::to_string(kMaxSide));
      }
    }
    parts_.push_back({spec, channels_.size()});
    const std::string prefix = prefixOf(spec);
    for (const std::string& channel : spec.channelnames) {
      const std::string name = prefix + channel;
      channels_.push_back({static_cast<uint32_t>(spec.full_width),
                           static_cast<uint32_t>(spec.full_height),
                           static_cast<uint32_t>(name.size())});
      names_ += name;
      // Rows are read at the width of what is stored, which may be wider than the image.
      const auto area = [](int width, int height) {
        return static_cast<uint64_t>(width) * static_cast<uint64_t>(height);
      };
      plane_bytes_ += sizeof(float) * std::max(area(spec.full_width, spec.full_height),
                                               area(spec.width, std::min(spec.height, kBandRows)));
    }
  }

  /// Parts that hold one layer may leave its name out of their channels.
  static std::string prefixOf(const OIIO::ImageSpec& spec) {
    const std::string part = spec.get_string_attribute("oiio:subimagename");
    const auto is_named = [](const std::string& channel) {
      return channel.find('.') != std::string::npos;
    };
    const bool any_named =
        std::any_of(spec.channelnames.begin(), spec.channelnames.end(), is_named);
    return part.empty() || any_named ? std::string() : part + ".";
  }

  std::string name_;
  std::vector<Part> parts_;
  std::vector<StippleMediaChannel> channels_;
  std::string names_;
  uint64_t plane_bytes_ = 0;
};

OIIO::TypeDesc typeOf(const OIIO::ImageSpec& spec, size_t channel) {
  return spec.channelformats.empty() ? spec.format : spec.channelformats[channel];
}

/// Values of one channel in a row, as they are: integers are counted, not scaled to 0..1.
void convertRow(const unsigned char* from, size_t stride, OIIO::TypeDesc type, int count,
                float* to) {
  if (type.basetype == OIIO::TypeDesc::UINT32) {
    for (int x = 0; x < count; ++x) {
      uint32_t value = 0;
      std::memcpy(&value, from + static_cast<size_t>(x) * stride, sizeof(value));
      to[x] = static_cast<float>(value);
    }
    return;
  }
  OIIO::convert_image(1, count, 1, 1, from, type, static_cast<OIIO::stride_t>(stride),
                      OIIO::AutoStride, OIIO::AutoStride, to, OIIO::TypeDesc::FLOAT,
                      OIIO::AutoStride, OIIO::AutoStride, OIIO::AutoStride);
}

/// Reads one part into its planes [full_height, full_width], which are 0 where the part has no
/// data.
void readPart(OIIO::ImageInput& input, int index, const Part& part,
              const std::vector<float*>& planes, const std::string& name) {
  const OIIO::ImageSpec& spec = part.spec;
  const int left = std::max(spec.x, spec.full_x);
  const int right = std::min(spec.x + spec.width, spec.full_x + spec.full_width);
  const bool is_whole = spec.x <= spec.full_x && spec.y <= spec.full_y &&
                        spec.x + spec.width >= spec.full_x + spec.full_width &&
                        spec.y + spec.height >= spec.full_y + spec.full_height;
  const auto plane_width = static_cast<size_t>(spec.full_width);
  const auto channel_count = static_cast<size_t>(spec.nchannels);
  if (!is_whole) {
    for (size_t c = 0; c < channel_count; ++c) {
      std::fill_n(planes[part.first_plane + c], plane_width * static_cast<size_t>(spec.full_height),
                  0.0f);
    }
  }
  const size_t pixel_bytes = spec.pixel_bytes(true);
  const size_t row_bytes = pixel_bytes * static_cast<size_t>(spec.width);
  const int band = spec.tile_height > 0
                       ? (kBandRows + spec.tile_height - 1) / spec.tile_height * spec.tile_height
                       : kBandRows;
  std::vector<unsigned char> pixels(row_bytes * static_cast<size_t>(std::min(band, spec.height)));
  for (int begin = spec.y; begin < spec.y + spec.height; begin += band) {
    const int end = std::min(begin + band, spec.y + spec.height);
    const bool is_read =
        spec.tile_width > 0
            ? input.read_tiles(index, 0, spec.x, spec.x + spec.width, begin, end, 0, 1, 0,
                               spec.nchannels, OIIO::TypeUnknown, pixels.data())
            : input.read_scanlines(index, 0, begin, end, 0, 0, spec.nchannels, OIIO::TypeUnknown,
                                   pixels.data());
    if (!is_read) fail(ErrorCode::kFormat, name + " cannot be decoded: " + input.geterror());
    for (int y = std::max(begin, spec.full_y); y < std::min(end, spec.full_y + spec.full_height);
         ++y) {
      const unsigned char* row = pixels.data() + row_bytes * static_cast<size_t>(y - begin) +
                                 pixel_bytes * static_cast<size_t>(std::max(0, left - spec.x));
      const size_t to = plane_width * static_cast<size_t>(y - spec.full_y) +
                        static_cast<size_t>(std::max(0, left - spec.full_x));
      size_t offset = 0;
      for (size_t c = 0; c < channel_count; ++c) {
        const OIIO::TypeDesc type = typeOf(spec, c);
        if (right > left) {
          convertRow(row + offset, pixel_bytes, type, right - left,
                     planes[part.first_plane + c] + to);
        }
        offset += type.size();
      }
    }
  }
}

}  // namespace

void stipple_media_exr_channels_read(const char* path, uint64_t limit_bytes,
                                     const StippleMediaSink* sink, StippleMediaStatus* status) {
  guard(path, status, [&] {
    const std::string name = path;
    const auto input = OIIO::ImageInput::create("openexr");
    OIIO::ImageSpec spec;
    if (!input || !input->open(name, spec)) {
      fail(ErrorCode::kFormat, name + " is not an EXR file that can be read: " +
                                   (input ? input->geterror() : OIIO::geterror()));
    }
    const Layout layout(*input, name);
    if (layout.planeBytes() > limit_bytes) {
      fail(ErrorCode::kMemoryLimit,
           name + " says that it holds " + std::to_string(layout.channels().size()) +
               " channels of " + std::to_string(layout.planeBytes()) + " bytes in all; at most " +
               std::to_string(limit_bytes) + " bytes are allowed");
    }
    requireAllowed(layout.planeBytes(), kImageAllowance, InputFile(name).size(), name,
                   std::to_string(layout.channels().size()) + " channels");
    give(*sink, kMediaChannels, layout.channels());
    giveBytes(*sink, kMediaChannelNames, layout.names().data(), layout.names().size());
    std::vector<float*> planes;
    for (const StippleMediaChannel& channel : layout.channels()) {
      planes.push_back(static_cast<float*>(
          allocate(*sink, kMediaChannelPlanes + static_cast<uint32_t>(planes.size()),
                   sizeof(float) * size_t{channel.width} * channel.height)));
    }
    for (size_t i = 0; i < layout.parts().size(); ++i) {
      readPart(*input, static_cast<int>(i), layout.parts()[i], planes, name);
    }
  });
}

}  // namespace stipple::media
