// The channels of all parts of an EXR file, by OpenEXR itself. Values are as they are: integers are
// counted, not scaled to 0..1.
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>

#include <algorithm>
#include <exception>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/limits.h"
#include "io/media/decoders/exr_layout.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

/// Rows that are read at once. A file that is cut off is found out before much memory is touched.
constexpr int kBandRows = 256;

struct Part {
  PictureHead windows;
  std::vector<ExrChannel> channels;
  size_t first_plane = 0;  ///< of the file's
};

struct Layout {
  std::vector<Part> parts;
  std::vector<StippleMediaChannel> channels;
  std::string names;
  uint64_t plane_bytes = 0;
};

/// Parts that hold one layer may leave its name out of their channels.
std::string prefixOf(const Imf::Header& header, const std::vector<ExrChannel>& channels) {
  const bool any_named = std::any_of(
      channels.begin(), channels.end(),
      [](const ExrChannel& channel) { return channel.name.find('.') != std::string::npos; });
  return any_named || !header.hasName() || header.name().empty() ? std::string()
                                                                 : header.name() + ".";
}

Layout layoutOf(const Imf::MultiPartInputFile& file, const std::string& path) {
  Layout layout;
  for (int index = 0; index < file.parts(); ++index) {
    const Imf::Header& header = file.header(index);
    Part part{exrWindows(header, path), exrChannels(header, path), layout.channels.size()};
    const std::string prefix = prefixOf(header, part.channels);
    const PictureHead& at = part.windows;
    const auto area = [](int64_t width, int64_t height) {
      return static_cast<uint64_t>(width) * static_cast<uint64_t>(height);
    };
    for (const ExrChannel& channel : part.channels) {
      const std::string name = prefix + channel.name;
      layout.channels.push_back({static_cast<uint32_t>(at.full_width),
                                 static_cast<uint32_t>(at.full_height),
                                 static_cast<uint32_t>(name.size())});
      layout.names += name;
      // Rows are read at the width of what is stored, which may be wider than the image.
      layout.plane_bytes +=
          sizeof(float) * std::max(area(at.full_width, at.full_height),
                                   area(at.width, std::min<int64_t>(at.height, kBandRows)));
    }
    layout.parts.push_back(std::move(part));
  }
  return layout;
}

/// Reads one part into its planes [full_height, full_width], which are 0 where it has no data.
void readPart(Imf::MultiPartInputFile& file, int index, const Part& part,
              const std::vector<float*>& planes) {
  const PictureHead& at = part.windows;
  const Imath::Box2i& data = file.header(index).dataWindow();
  const auto plane_width = static_cast<size_t>(at.full_width);
  for (size_t c = 0; c < part.channels.size(); ++c) {
    std::fill_n(planes[part.first_plane + c], plane_width * static_cast<size_t>(at.full_height),
                0.0f);
  }
  const int64_t left = std::max<int64_t>(at.x, 0);
  const int64_t right = std::min(at.x + at.width, at.full_width);
  const auto width = static_cast<size_t>(at.width);
  std::vector<float> band(width * static_cast<size_t>(std::min<int64_t>(kBandRows, at.height)) *
                          part.channels.size());
  const size_t plane = band.size() / std::max<size_t>(part.channels.size(), 1);
  Imf::InputPart input(file, index);
  for (int64_t row = 0; row < at.height; row += kBandRows) {
    const int64_t end = std::min<int64_t>(row + kBandRows, at.height);
    Imf::FrameBuffer buffer;
    for (size_t c = 0; c < part.channels.size(); ++c) {
      char* const base = reinterpret_cast<char*>(band.data() + c * plane) -
                         static_cast<ptrdiff_t>(sizeof(float)) * data.min.x -
                         static_cast<ptrdiff_t>(width * sizeof(float)) * (data.min.y + row);
      buffer.insert(part.channels[c].name,
                    Imf::Slice(Imf::FLOAT, base, sizeof(float), width * sizeof(float)));
    }
    input.setFrameBuffer(buffer);
    input.readPixels(static_cast<int>(data.min.y + row), static_cast<int>(data.min.y + end - 1));
    for (int64_t y = std::max<int64_t>(row, -at.y); y < end && y + at.y < at.full_height; ++y) {
      if (right <= left) break;
      for (size_t c = 0; c < part.channels.size(); ++c) {
        const float* from = band.data() + c * plane + static_cast<size_t>(y - row) * width +
                            static_cast<size_t>(left - at.x);
        std::copy_n(from, right - left,
                    planes[part.first_plane + c] + static_cast<size_t>(y + at.y) * plane_width +
                        static_cast<size_t>(left));
      }
    }
  }
}

void readChannels(const std::string& path, uint64_t limit_bytes, const StippleMediaSink& sink) {
  const InputFile bytes(path);  // says why where it cannot be opened
  ExrStream stream(path);
  Imf::MultiPartInputFile file(stream.stream);
  const Layout layout = layoutOf(file, path);
  if (layout.plane_bytes > limit_bytes) {
    fail(ErrorCode::kMemoryLimit,
         path + " says that it holds " + std::to_string(layout.channels.size()) + " channels of " +
             std::to_string(layout.plane_bytes) + " bytes in all; at most " +
             std::to_string(limit_bytes) + " bytes are allowed");
  }
  requireAllowed(layout.plane_bytes, kImageAllowance, bytes.size(), path,
                 std::to_string(layout.channels.size()) + " channels");
  give(sink, kMediaChannels, layout.channels);
  giveBytes(sink, kMediaChannelNames, layout.names.data(), layout.names.size());
  std::vector<float*> planes;
  for (const StippleMediaChannel& channel : layout.channels) {
    planes.push_back(static_cast<float*>(
        allocate(sink, kMediaChannelPlanes + static_cast<uint32_t>(planes.size()),
                 sizeof(float) * size_t{channel.width} * channel.height)));
  }
  for (size_t i = 0; i < layout.parts.size(); ++i) {
    readPart(file, static_cast<int>(i), layout.parts[i], planes);
  }
}

}  // namespace

void stipple_media_exr_channels_read(const char* path, uint64_t limit_bytes,
                                     const StippleMediaSink* sink, StippleMediaStatus* status) {
  guard(path, status, [&] {
    try {
      readChannels(path, limit_bytes, *sink);
    } catch (const Error&) {
      throw;
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      fail(ErrorCode::kFormat,
           std::string(path) + " is not an EXR file that can be read: " + error.what());
    }
  });
}

}  // namespace stipple::media
