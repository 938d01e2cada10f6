// Based on: Pixar, "Usdz File Format Specification" 1.3: stored entries, their bytes at multiples
// of 64, the layer first.
#include "io/usd/usd_file.h"

#include "io/bytes/input_file.h"
#include "io/bytes/zip_file.h"

namespace stipple {

namespace {

constexpr uint64_t kPackageAlignment = 64;

}  // namespace

UsdFile::UsdFile(const std::string& path)
    : file_(path), is_package_(lowerExtension(path) == ".usdz") {}

void UsdFile::put(const std::string& text) {
  if (is_package_) {
    layer_.insert(layer_.end(), text.begin(), text.end());
  } else {
    file_.write(text.data(), text.size());
  }
}

void UsdFile::commit() {
  if (is_package_) {
    ZipWriter package(file_, kPackageAlignment);
    package.add("splats.usda", layer_);
    package.finish();
  }
  file_.commit();
}

}  // namespace stipple
