#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/bytes/output_file.h"
#include "io/splats/splat_format.h"
#include "io/usd/usd_file.h"

namespace stipple {

/// Splats at times as one layer of text, or a package with it: arrays with time samples, of one
/// prim. One frame is in memory (of a package all of its text); the text of the arrays lies in
/// files beside the output until it is whole, which no other program sees under a name of its own.
class UsdSeriesWriter {
 public:
  /// In: frames_per_second > 0; options, as of writeSplatFile.
  /// Errors: kInvalidArgument, kUnsupported for paths of other formats, kIo.
  UsdSeriesWriter(const std::string& path, double frames_per_second,
                  const SplatWriteOptions& options);
  /// In: cloud, of the degree (after the options' limit), colour space and filter of those before,
  /// or empty: nothing is drawn at its time then; frame, above that of the cloud before.
  /// Errors: kInvalidArgument, kIo.
  void add(const SplatCloud& cloud, double frame);
  /// Errors: kInvalidArgument where no cloud with splats was added, kIo.
  void finish();

 private:
  void put(size_t array, const std::string& text);

  const SplatFormat* format_;
  UsdFile file_;
  std::string path_;
  SplatWriteOptions options_;
  double frames_per_second_;
  std::optional<SplatCloud> like_;  ///< without splats; nothing until one has some
  std::optional<double> first_, last_;
  std::vector<std::unique_ptr<OutputFile>> samples_;  ///< of the extent, then of each array
};

}  // namespace stipple
