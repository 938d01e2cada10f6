#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/bytes/output_file.h"

namespace stipple {

/// A layer of text that appears under its name when it is whole, or a package (.usdz) with it,
/// which is gathered in memory. Errors: those of OutputFile; kUnsupported for packages above 4 GiB.
class UsdFile {
 public:
  explicit UsdFile(const std::string& path);
  void put(const std::string& text);
  void commit();

 private:
  OutputFile file_;
  bool is_package_;
  std::vector<uint8_t> layer_;  ///< of a package
};

}  // namespace stipple
