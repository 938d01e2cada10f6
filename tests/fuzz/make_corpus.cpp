// Writes a folder of small valid files per format, from which the fuzzers start.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <string>

#include "io/ksplat_builder.h"
#include "io/random_cloud.h"
#include "io/splat_file.h"

namespace {

namespace fs = std::filesystem;

void writeAll(const fs::path& folder) {
  for (const stipple::SplatFormat& format : stipple::splatFormats()) {
    const fs::path place = folder / format.name;
    fs::create_directories(place);
    const std::string endings = format.endings;
    const std::string ending = endings.substr(0, endings.find(' '));
    if (format.write == nullptr) continue;
    for (const int degree : {0, 1, 3}) {
      const stipple::SplatCloud cloud = stipple::randomCloud(5, degree, 1);
      const std::string name = "degree" + std::to_string(degree);
      stipple::writeSplatFile(cloud, place / (name + ending), {});
      if (ending == ".ply") {
        stipple::writeSplatFile(cloud, place / (name + "_text" + ending), {.ascii = true});
      }
      if (ending == ".spz") {
        stipple::writeSplatFile(cloud, place / (name + "_old" + ending), {.version = 3});
      }
    }
  }
  for (unsigned level = 0; level < 3; ++level) {
    stipple::RawKsplat raw;
    raw.level = level;
    raw.degree = level;
    std::ofstream(folder / "ksplat" / ("level" + std::to_string(level)), std::ios::binary)
        << raw.bytes();
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "make_corpus: 1 folder to write to is expected\n");
    return 2;
  }
  try {
    writeAll(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_corpus: %s\n", error.what());
    return 1;
  }
  return 0;
}
