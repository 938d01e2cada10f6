#include "api/guard.h"
#include "api/handles.h"
#include "api/job.h"
#include "data/images/image_comparison.h"
#include "io/assets/weight_file.h"
#include "io/image_file.h"
#include "measure/perceptual_distance.h"

using namespace stipple;
using namespace stipple::api;

extern "C" {

StippleStatus stipple_image_create(StippleContext* context, uint32_t width, uint32_t height,
                                   uint32_t channels, uint32_t transfer, const float* pixels,
                                   StippleImage** image) {
  return guarded([&] {
    require(context, "context");
    require(pixels, "pixels");
    require(image, "image");
    if (width < 1 || height < 1 || (channels != 1 && channels != 3 && channels != 4)) {
      fail(ErrorCode::kInvalidArgument,
           "the image is " + std::to_string(width) + " x " + std::to_string(height) + " with " +
               std::to_string(channels) +
               " channels; sides of at least 1 and 1, 3 or 4 channels are allowed");
    }
    Image made;
    made.width = width;
    made.height = height;
    made.channels = channels;
    made.transfer = enumValue<Transfer>(transfer, 1, "transfer");
    made.pixels.assign(pixels, pixels + made.pixelCount() * channels);
    *image = new StippleImage{context->state, std::make_shared<const Image>(std::move(made))};
  });
}

StippleStatus stipple_image_load(StippleContext* context, const char* path_utf8,
                                 StippleImage** image) {
  return guarded([&] {
    require(context, "context");
    require(image, "image");
    const std::string path = &require(path_utf8, "path_utf8");
    *image = new StippleImage{context->state, std::make_shared<const Image>(readImageFile(path))};
  });
}

void stipple_image_free(StippleImage* image) {
  delete image;
}

StippleStatus stipple_image_info(const StippleImage* image, StippleImageInfo* info) {
  return guarded([&] {
    const Image& picture = *require(image, "image").image;
    StippleImageInfo out = {};
    out.width = picture.width;
    out.height = picture.height;
    out.channels = picture.channels;
    out.transfer = static_cast<uint32_t>(picture.transfer);
    deliver(info, out, "info");
  });
}

StippleStatus stipple_image_read(const StippleImage* image, float* pixels, uint64_t capacity) {
  return guarded([&] {
    const Image& picture = *require(image, "image").image;
    require(pixels, "pixels");
    requireCapacity(picture.pixels.size(), capacity, "floats");
    std::memcpy(pixels, picture.pixels.data(), picture.pixels.size() * sizeof(float));
  });
}

StippleStatus stipple_image_save(const StippleImage* image, const char* path_utf8,
                                 uint32_t keep_values) {
  return guarded([&] {
    const bool keep = enumValue<uint32_t>(keep_values, 1, "keep_values") == 1;
    writeImageFile(*require(image, "image").image, &require(path_utf8, "path_utf8"), keep);
  });
}

StippleStatus stipple_image_compare(const StippleImage* a, const StippleImage* b,
                                    StippleImageComparison* result) {
  return guarded([&] {
    const ImageComparison made = compare(*require(a, "a").image, *require(b, "b").image);
    StippleImageComparison out = {};
    out.psnr = made.psnr;
    out.ssim = made.ssim;
    out.max_error = made.max_error;
    out.mean_error = made.mean_error;
    deliver(result, out, "result");
  });
}

StippleStatus stipple_image_lpips_start(const StippleImage* a, const StippleImage* b,
                                        const char* weights_utf8, double* distance,
                                        StippleJob** job) {
  return guarded([&] {
    const std::shared_ptr<const Image> first = require(a, "a").image;
    const std::shared_ptr<const Image> second = require(b, "b").image;
    const std::string path = &require(weights_utf8, "weights_utf8");
    require(distance, "distance");
    require(job, "job");
    const Context context = a->context;
    const PerceptualDistance measure(openWeightFile(path));
    context->requireMemory(measure.memoryBound(first->pixelCount()), "LPIPS of the images");
    *job = startJob(context, [measure, first, second, distance](Progress& progress) {
      const NetworkRun run = {.progress = &progress};
      *distance = measure.between(run, *first, *second);
      return JobResult{};
    });
  });
}

}  // extern "C"
