#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"

namespace stipple {

/// What the options of writing a splat file say; fields that a format has no use for are passed
/// over.
struct SplatWriteOptions {
  bool ascii = false;                  ///< PLY: text instead of little-endian binary
  bool half = false;                   ///< USD: all but positions in half precision
  int sh_degree_limit = kMaxShDegree;  ///< harmonics above this degree are left out
  int version = 0;                ///< of the format (SPZ: 3 or 4); 0: the newest that is written
  Frame frame = Frame::kUnknown;  ///< positions are written in this frame; unknown: the format's
};

/// How a file begins, for telling its format.
struct SplatFileStart {
  std::string path;
  std::string name;   ///< file name in lower case, without its folder
  std::string bytes;  ///< the first kSplatProbeBytes bytes, fewer where the file is shorter
  bool is_folder = false;
};
constexpr size_t kSplatProbeBytes = 4096;

/// What a file says of its splats beside their numbers, so that reading it gives that back.
struct SplatFormatKeeps {
  bool frame = false;         ///< which way the axes point, also another than the format's own
  bool colour_space = false;  ///< else colours of linear clouds become display colours first
  bool antialias = false;     ///< the low-pass filter that the splats were made for
};

/// Numbers of a splat's harmonics above degree 0.
inline double higherHarmonics(int degree) {
  return static_cast<double>((shCoefficientCount(degree) - 1) * 3);
}

/// One format of splat files: a row of the table in splat_format.cpp.
struct SplatFormat {
  const char* name;   ///< one word, for options and messages: "ply"
  const char* title;  ///< for people: "3DGS PLY"
  /// What file names end with, lower case, separated by blanks, the usual one first.
  const char* extensions;
  int max_sh_degree;  ///< higher harmonics are left out when written
  /// The frame that positions are written in: a cloud of another known frame is converted first.
  /// One of an unknown frame counts as kConventionalFrame.
  Frame frame;
  SplatFormatKeeps keeps = {};
  /// True where the first bytes (or a folder's name) say that a file is of this format; null where
  /// nothing but the extension tells.
  bool (*probe)(const SplatFileStart& start) = nullptr;
  SplatCloud (*read)(const std::string& path, Progress* progress) = nullptr;  ///< null: not read
  /// In: a cloud in its frame and colour space, of its degree (of any, where takes_any_degree) and
  /// valid, unless checks_values: then its sizes are, and the writer refuses values that are not
  /// valid. Null: not written.
  void (*write)(const SplatCloud& cloud, const std::string& path, const SplatWriteOptions& options,
                Progress* progress) = nullptr;
  /// About how many bytes a file of so many splats takes, all of its files together. In: degree of
  /// the harmonics that are written, at most max_sh_degree. Null where the format is not written.
  double (*estimate)(uint64_t count, int degree, const SplatWriteOptions& options) = nullptr;
  bool checks_values = false;     ///< with a RowCheck, which saves a pass through memory
  bool holds_times = false;       ///< one file may hold a series (UsdSeriesWriter)
  bool takes_any_degree = false;  ///< passes over higher harmonics itself, without a copy
};

/// All formats, in the order in which files are tried.
const std::vector<SplatFormat>& splatFormats();

/// About how many bytes a file of so many splats takes. In: degree of the cloud, which the format
/// and the options may lower. Out: 0 where the format is not written.
uint64_t estimatedFileBytes(const SplatFormat& format, uint64_t count, int degree,
                            const SplatWriteOptions& options);

/// The format that a file's content has, or its extension where the format has no first bytes of
/// its own; null for files of no format that can be read. Errors: kIo.
const SplatFormat* splatFormatOfContent(const std::string& path);

/// The format whose extension the path has (the longest that fits), or null.
const SplatFormat* splatFormatOfExtension(const std::string& path);

}  // namespace stipple
