// libFuzzer target of one reader. Whatever the bytes are, reading gives something valid or an
// Error; anything else (a crash, a sanitizer's report, an exception of another kind, minutes,
// gigabytes) is found. Environment: STIPPLE_FUZZ_READER, the name of the reader;
// STIPPLE_FUZZ_FOLDER, an empty folder to work in.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "base/error.h"
#include "io/media_library.h"
#include "json_mutation.h"
#include "readers.h"

/// libFuzzer's own mutation of bytes.
extern "C" size_t LLVMFuzzerMutate(uint8_t* bytes, size_t size, size_t most_size);

namespace {

std::string setting(const char* name) {
  const char* value = std::getenv(name);
  if (value != nullptr) return value;
  std::fprintf(stderr, "%s is not set\n", name);
  std::exit(2);
}

const stipple::fuzz::Reader& chosenReader() {
  const std::string name = setting("STIPPLE_FUZZ_READER");
  for (const stipple::fuzz::Reader& reader : stipple::fuzz::readers()) {
    if (reader.name == name) return reader;
  }
  std::fprintf(stderr, "no reader is called '%s'\n", name.c_str());
  std::exit(2);
}

std::filesystem::path preparedFolder(const stipple::fuzz::Reader& reader) {
  std::filesystem::path folder = setting("STIPPLE_FUZZ_FOLDER");
  if (reader.prepare) reader.prepare(folder);
  return folder;
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  // Loading it takes longer than any input may.
  stipple::mediaTable();
  return 0;
}

/// Half of the inputs of a reader of JSON stay JSON, of which one value is another.
extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* bytes, size_t size, size_t most_size,
                                          unsigned seed) {
  static const stipple::fuzz::JsonPlace kPlace = chosenReader().json;
  if (kPlace != stipple::fuzz::JsonPlace::kNowhere && seed % 2 == 0) {
    const std::string made = stipple::fuzz::withMutatedJson(
        std::string(reinterpret_cast<const char*>(bytes), size), kPlace, seed);
    if (!made.empty() && made.size() <= most_size) {
      std::copy(made.begin(), made.end(), bytes);
      return made.size();
    }
  }
  return LLVMFuzzerMutate(bytes, size, most_size);
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
  static const stipple::fuzz::Reader& kReader = chosenReader();
  static const std::filesystem::path kFolder = preparedFolder(kReader);
  kReader.store(kFolder, std::string(reinterpret_cast<const char*>(bytes), size));
  try {
    kReader.read(kFolder);
  } catch (const stipple::Error& error) {
    // A file may be refused; that nothing else went wrong is told by the kind of the error and by a
    // message of one line.
    const bool refused = error.code() == stipple::ErrorCode::kFormat ||
                         error.code() == stipple::ErrorCode::kUnsupported ||
                         error.code() == stipple::ErrorCode::kIo;
    const std::string message = error.what();
    if (!refused || message.empty() || message.find('\n') != message.npos) {
      std::fprintf(stderr, "error %d: %s\n", static_cast<int>(error.code()), message.c_str());
      std::abort();
    }
  }
  return 0;
}
