#include <cstring>

#include "api/guard.h"
#include "api/handles.h"
#include "io/image_channels.h"

using namespace stipple;
using namespace stipple::api;

namespace {

const ImageChannel& channelOf(const StippleImageChannels* channels, uint64_t index) {
  const std::vector<ImageChannel>& list = *require(channels, "channels").channels;
  if (index >= list.size()) {
    fail(ErrorCode::kInvalidArgument, "index is " + std::to_string(index) + "; the file has " +
                                          std::to_string(list.size()) + " channels");
  }
  return list[static_cast<size_t>(index)];
}

}  // namespace

extern "C" {

StippleStatus stipple_image_channels_load(StippleContext* context, const char* path_utf8,
                                          StippleImageChannels** channels) {
  return guarded([&] {
    require(context, "context");
    require(channels, "channels");
    *channels = new StippleImageChannels{
        context->state, std::make_shared<const std::vector<ImageChannel>>(readImageChannels(
                            &require(path_utf8, "path_utf8"), context->state->memory_limit_bytes))};
  });
}

void stipple_image_channels_free(StippleImageChannels* channels) {
  delete channels;
}

uint64_t stipple_image_channels_count(const StippleImageChannels* channels) {
  return channels ? channels->channels->size() : 0;
}

StippleStatus stipple_image_channels_info(const StippleImageChannels* channels, uint64_t index,
                                          StippleImageChannelInfo* info) {
  return guarded([&] {
    const ImageChannel& channel = channelOf(channels, index);
    StippleImageChannelInfo out = {};
    out.width = channel.width;
    out.height = channel.height;
    out.name_utf8 = channel.name.c_str();
    deliver(info, out, "info");
  });
}

StippleStatus stipple_image_channels_read(const StippleImageChannels* channels, uint64_t index,
                                          float* values, uint64_t capacity) {
  return guarded([&] {
    const ImageChannel& channel = channelOf(channels, index);
    require(values, "values");
    requireCapacity(channel.values.size(), capacity, "floats");
    std::memcpy(values, channel.values.data(), channel.values.size() * sizeof(float));
  });
}

}  // extern "C"
