// Writes the four files of weights that turn an image into splats, in the names, shapes and types
// of the published ones, with numbers that are made up.
//
//   full_size_weights FOLDER
//
// 3.3 GB. Files that are there are left. Prints the bytes of each beside those of the published
// one: they may differ by what the headers say.

#include <cinttypes>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "io/assets/weights_folder.h"
#include "peers/full_size_files.h"

int main(int count, char** arguments) {
  using namespace stipple;
  if (count != 2) {
    std::fprintf(stderr, "full_size_weights FOLDER\n");
    return 2;
  }
  try {
    for (const auto write : {structureFileIn, colourFileIn, flowFileIn, decoderFileIn}) {
      write(arguments[1]);
    }
    const WeightsFolder folder = findWeights(arguments[1]);
    for (const PublishedWeights& published : publishedWeights()) {
      const WeightsFile& file = requireWeights(folder, published.role);
      std::printf("%-26s %12" PRIu64 " bytes, published %12" PRIu64 "\n", published.label,
                  file.bytes, published.bytes);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
