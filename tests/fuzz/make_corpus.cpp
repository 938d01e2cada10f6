// Writes a folder of small valid files per reader, from which the fuzzers start.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

#include "readers.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr,
                 "make_corpus: 2 folders are expected, to write to and an empty one to work in\n");
    return 2;
  }
  try {
    for (const stipple::fuzz::Reader& reader : stipple::fuzz::readers()) {
      const std::filesystem::path place = std::filesystem::path(argv[1]) / reader.name;
      const std::filesystem::path work = std::filesystem::path(argv[2]) / reader.name;
      std::filesystem::create_directories(place);
      std::filesystem::create_directories(work);
      size_t number = 0;
      for (const std::string& bytes : reader.seeds(work)) {
        stipple::fuzz::storeFile(place / ("seed" + std::to_string(number++)), bytes);
      }
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_corpus: %s\n", error.what());
    return 1;
  }
  return 0;
}
