// libFuzzer target of one reader. Whatever the bytes are, reading gives something valid or an
// Error; anything else (a crash, a sanitizer's report, an exception of another kind, minutes,
// gigabytes) is found. Environment: STIPPLE_FUZZ_READER, the name of the reader;
// STIPPLE_FUZZ_FOLDER, an empty folder to work in.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "base/error.h"
#include "io/media_library.h"
#include "readers.h"

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
