// Pictures of a data set against OpenImageIO's own decoding of the same file to bytes. Files lie in
// memory (/dev/shm); no picture is kept, but in the last case. A picture is decoded to float32,
// checked, packed to 16 bits and unpacked, all of which the plain read leaves out.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "bench/comparison.h"
#include "bench/oiio_read.h"
#include "io/image_file.h"
#include "io/views/dataset.h"

namespace stipple::bench {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t kWidth = 1920, kHeight = 1080;

/// A folder with one picture of 2 Mpx, smooth with some grain as photographs are, and its camera.
class Folder {
 public:
  explicit Folder(const std::string& lens)
      : path_("/dev/shm/stipple_bench_dataset_" + std::to_string(::getpid())) {
    fs::create_directories(path_);
    Image image;
    image.width = kWidth;
    image.height = kHeight;
    image.channels = 3;
    image.transfer = Transfer::kSrgb;
    image.pixels.reserve(image.pixelCount() * 3);
    uint32_t grain = 1;
    for (uint32_t y = 0; y < kHeight; ++y) {
      for (uint32_t x = 0; x < kWidth; ++x) {
        for (uint32_t c = 0; c < 3; ++c) {
          grain = grain * 1664525u + 1013904223u;
          const double wave = std::sin(0.01 * x + c) * std::cos(0.013 * y);
          image.pixels.push_back(
              static_cast<float>(0.5 + 0.4 * wave + 0.02 * (grain >> 24) / 255.0));
        }
      }
    }
    writeImageFile(image, picture());
    std::ofstream(path_ / "transforms.json")
        << "{\"fl_x\": 1500, \"w\": " << kWidth << ", \"h\": " << kHeight << lens
        << ", \"frames\": [{\"file_path\": \"a.png\", \"transform_matrix\": "
           "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}";
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  std::string path() const { return path_.string(); }
  std::string picture() const { return (path_ / "a.png").string(); }

 private:
  fs::path path_;
};

void againstPlainRead(benchmark::State& state, const std::string& lens, uint32_t downscale) {
  const Folder folder(lens);
  const auto dataset = openDataset(folder.path(), {.downscale = downscale, .cache_bytes = 0});
  compare(
      state, "oiio_read", [&] { benchmark::DoNotOptimize(dataset->load(0)); },
      [&] { benchmark::DoNotOptimize(readByOpenImageIo(folder.picture())); });
}

void pinhole(benchmark::State& state) {
  againstPlainRead(state, "", 1);
}
void distorted(benchmark::State& state) {
  againstPlainRead(state, ", \"k1\": -0.1, \"k2\": 0.01, \"p1\": 0.001", 1);
}
void fisheye(benchmark::State& state) {
  againstPlainRead(state, ", \"is_fisheye\": true, \"k1\": 0.01", 1);
}
void quarter(benchmark::State& state) {
  againstPlainRead(state, "", 4);
}

/// A picture that is kept costs its unpacking.
void kept(benchmark::State& state) {
  const Folder folder("");
  const auto dataset = openDataset(folder.path());
  dataset->load(0);
  compare(
      state, "oiio_read", [&] { benchmark::DoNotOptimize(dataset->load(0)); },
      [&] { benchmark::DoNotOptimize(readByOpenImageIo(folder.picture())); });
}

BENCHMARK(pinhole)
    ->Name("io.dataset_load.pinhole_2mp")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(distorted)
    ->Name("io.dataset_load.opencv_2mp")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(fisheye)
    ->Name("io.dataset_load.fisheye_2mp")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(quarter)
    ->Name("io.dataset_load.downscale4_2mp")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(kept)->Name("io.dataset_load.kept_2mp")->UseManualTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stipple::bench
