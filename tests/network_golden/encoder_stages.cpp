// From an image to the condition of a flow network: preparation, DINOv3, the FLUX.2 encoder.

#include <array>
#include <string>
#include <vector>

#include "generate/dino_encoder.h"
#include "generate/image_condition.h"
#include "generate/image_preparation.h"
#include "generate/vae_encoder.h"
#include "network_golden/stages.h"

namespace stipple {
namespace {

// Another order of the same sums of float32 differs by 3e-6 (transformer) and, at magnitudes of
// 158, by 1.3e-4 (autoencoder); these leave room for other processors.
constexpr StageTolerance kDinoTolerance = {2e-5, 0.0};
constexpr StageTolerance kVaeTolerance = {1e-4, 1e-5};
// Bytes divided, shifted and divided: three roundings of numbers below 3.
constexpr StageTolerance kPixelTolerance = {1e-6, 0.0};

/// [channels, pixels] of [pixels, channels].
std::vector<float> channelsFirst(const StageNumbers& numbers) {
  std::vector<float> planes(numbers.rows * numbers.width);
  for (size_t row = 0; row < numbers.rows; ++row) {
    for (size_t c = 0; c < numbers.width; ++c) {
      planes[c * numbers.rows + row] = numbers.values[row * numbers.stride + c];
    }
  }
  return planes;
}

std::vector<float> rowsOf(const StageNumbers& numbers) {
  std::vector<float> rows;
  for (size_t row = 0; row < numbers.rows; ++row) {
    const float* from = numbers.values + row * numbers.stride;
    rows.insert(rows.end(), from, from + numbers.width);
  }
  return rows;
}

/// [heads, rows, head width] of [rows, heads * head width].
std::vector<float> headsFirst(const StageNumbers& numbers, size_t head_width) {
  std::vector<float> heads;
  for (size_t first = 0; first < numbers.width; first += head_width) {
    for (size_t row = 0; row < numbers.rows; ++row) {
      const float* from = numbers.values + row * numbers.stride + first;
      heads.insert(heads.end(), from, from + head_width);
    }
  }
  return heads;
}

/// [height, width, 3] of [1, 3, height, width], each number by `change(number, channel)`.
template <typename Change>
std::vector<float> channelsLast(const std::vector<float>& planes, const Change& change) {
  std::vector<float> pixels(planes.size());
  const size_t count = planes.size() / 3;
  for (size_t i = 0; i < planes.size(); ++i) {
    pixels[i % count * 3 + i / count] = change(planes[i], i / count);
  }
  return pixels;
}

DinoOptions dinoOptions(const nlohmann::json& config) {
  DinoOptions options;
  options.head_width =
      config.at("hidden_size").get<size_t>() / config.at("num_heads").get<size_t>();
  return options;
}

void dinoStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("weights.embeddings.cls_token") || !file.has("input.pixel_values")) return;
  const DinoOptions options = dinoOptions(file.config());
  const DinoEncoder encoder(file.weights(), options);
  const std::vector<uint64_t> shape = file.shape("input.pixel_values");
  const std::vector<uint8_t> bytes = file.bytes("input.image");
  std::vector<float> rgb(bytes.begin(), bytes.end());
  for (float& value : rgb) value /= 255.0f;
  // What the network itself makes of bytes is tested by its first stage; here whether it is given
  // what the file's network saw.
  const std::vector<float> mean = file.config().at("image_mean").get<std::vector<float>>();
  const std::vector<float> deviation = file.config().at("image_std").get<std::vector<float>>();
  const std::vector<float> seen = channelsLast(
      file.floats("input.pixel_values"),
      [&](float value, size_t channel) { return value * deviation[channel] + mean[channel]; });
  report.compare("pixels", rgb, seen, kPixelTolerance);
  encoder.encode(file.run(), rgb, shape[2], shape[3],
                 [&](const std::string& stage, const StageNumbers& numbers) {
                   const std::string name = "expect." + stage;
                   if (!file.has(name)) return;
                   const std::vector<float> expected = file.floats(name);
                   const bool has_heads = stage.ends_with("_rope");
                   report.compare(
                       stage, has_heads ? headsFirst(numbers, options.head_width) : rowsOf(numbers),
                       expected, kDinoTolerance);
                 });
}

void vaeStages(const GoldenFile& file, StageReport& report) {
  if (!file.has("weights.encoder.conv_in.weight") || !file.has("input.image")) return;
  VaeOptions options;
  options.groups = file.config().at("norm_num_groups").get<size_t>();
  options.norm_epsilon = file.config().at("group_norm_eps").get<float>();
  options.token_epsilon = file.config().at("batch_norm_eps").get<float>();
  const VaeEncoder encoder(file.weights(), options);
  const std::vector<uint64_t> shape = file.shape("input.image");
  const std::vector<float> rgb =
      channelsLast(file.floats("input.image"), [](float value, size_t) { return value; });
  const std::vector<float> tokens = encoder.encode(
      file.run(), rgb, shape[2], shape[3], file.floats("input.noise"),
      [&](const std::string& stage, const StageNumbers& numbers) {
        const std::string name = "expect." + stage;
        if (!file.has(name)) return;
        report.compare(stage, stage == "tokens" ? rowsOf(numbers) : channelsFirst(numbers),
                       file.floats(name), kVaeTolerance);
      });
  if (file.has("expect.feature2")) {
    std::vector<float> feature(
        file.config().at("zero_prefix_tokens").get<size_t>() * encoder.tokenWidth(), 0.0f);
    feature.insert(feature.end(), tokens.begin(), tokens.end());
    report.compare("feature2", feature, file.floats("expect.feature2"), kVaeTolerance);
  }
  if (file.has("expect.tokens_mean")) {
    report.compare("tokens_mean", encoder.encode(file.run(), rgb, shape[2], shape[3], {}),
                   file.floats("expect.tokens_mean"), kVaeTolerance);
  }
}

ByteImage byteImage(const GoldenFile& file, const std::string& name) {
  const std::vector<uint64_t> shape = file.shape(name);
  return {static_cast<uint32_t>(shape.at(1)), static_cast<uint32_t>(shape.at(0)),
          static_cast<uint32_t>(shape.at(2)), file.bytes(name)};
}

/// In: prefix: "" or "b.", of the file's images.
void preparationStages(const GoldenFile& file, const std::string& prefix, StageReport& report) {
  const std::string image = "input." + prefix + "image_rgba";
  if (!file.has(image)) return;
  PreparationOptions options;
  options.canvas_size = file.config().at("canvas_size").get<uint32_t>();
  options.erode_radius = file.config().at(prefix + "erode_radius").get<uint32_t>();
  PreparationSteps steps;
  const PreparedImage prepared = prepareImage(byteImage(file, image), nullptr, options, &steps);
  const auto compareBytes = [&](const std::string& step, const std::vector<uint8_t>& seen) {
    const std::string name = prefix + "prep." + step;
    if (file.has("expect." + name)) {
      report.compareExactly(name, seen, file.bytes("expect." + name));
    }
  };
  const auto compareCorners = [&](const std::string& step, const std::array<int32_t, 4>& seen) {
    const std::string name = prefix + "prep." + step;
    if (file.has("expect." + name)) {
      report.compareExactly(name, std::vector<int64_t>(seen.begin(), seen.end()),
                            file.integers("expect." + name));
    }
  };
  compareBytes("resized", steps.resized.pixels);
  compareBytes("eroded_alpha", steps.eroded_alpha.pixels);
  compareCorners("bbox", prepared.box);
  compareCorners("crop_box", prepared.crop);
  compareBytes("cropped", steps.cropped.pixels);
  compareBytes("square", steps.squared.pixels);
  compareBytes("prepared", prepared.rgb);
}

void conditionStages(const GoldenFile& file, StageReport& report) {
  if (!file.hasUnder("weights.dino.") || !file.hasUnder("weights.vae.")) return;
  const DinoEncoder structure(file.weights("dino."), dinoOptions(file.config().at("dino")));
  const VaeEncoder colour(file.weights("vae."));
  PreparationOptions options;
  options.canvas_size = file.config().at("canvas_size").get<uint32_t>();
  options.erode_radius = file.config().at("erode_radius").get<uint32_t>();
  const PreparedImage image = prepareImage(byteImage(file, "input.image_rgba"), nullptr, options);
  const ImageCondition condition =
      encodeImage(file.run(), structure, colour, image, file.floats("input.vae_noise"));
  report.compare("feature1", condition.structure, file.floats("expect.feature1"), kDinoTolerance);
  report.compare("feature2", condition.colour, file.floats("expect.feature2"), kVaeTolerance);
}

}  // namespace

void encoderStages(const GoldenFile& file, StageReport& report) {
  dinoStages(file, report);
  vaeStages(file, report);
  preparationStages(file, "", report);
  preparationStages(file, "b.", report);
  conditionStages(file, report);
}

}  // namespace stipple
