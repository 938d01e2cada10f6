#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"

namespace stipple {

/// What the options of writing a splat file say; fields that a format has no use for are passed
/// over.
struct SplatWriteOptions {
  bool ascii = false;                  ///< PLY: text instead of little-endian binary
  int sh_degree_limit = kMaxShDegree;  ///< harmonics above this degree are left out
  int version = 0;                ///< of the format (SPZ: 3 or 4); 0: the newest that is written
  Frame frame = Frame::kUnknown;  ///< positions are written in this frame; unknown: the format's
};

/// How a file begins, for telling its format.
struct SplatFileStart {
  std::string path;
  std::string name;   ///< file name in lower case, without its folder
  std::string bytes;  ///< the first kSplatSniffBytes bytes, fewer where the file is shorter
  bool is_folder = false;
};
constexpr size_t kSplatSniffBytes = 4096;

/// One format of splat files: a row of the table in splat_file.cpp.
struct SplatFormat {
  const char* name;   ///< one word, for options and messages: "ply"
  const char* title;  ///< for people: "3DGS PLY"
  const char*
      endings;  ///< what file names end with, lower case, separated by blanks, usual one first
  int max_sh_degree;  ///< higher harmonics are left out when written
  /// The frame that positions are written in: a cloud of another known frame is converted first.
  /// One of an unknown frame counts as kConventionalFrame.
  Frame frame;
  bool holds_linear;  ///< else colours of linear clouds are converted to display space first
  /// True where the first bytes (or a folder's name) say that a file is of this format; null where
  /// nothing but the ending tells.
  bool (*sniff)(const SplatFileStart& start);
  SplatCloud (*read)(const std::string& path, Progress* progress);  ///< null: not read
  /// In: a cloud in its frame and colour space, of its degree (of any, where takes_any_degree) and
  /// valid, unless checks_values: then its sizes are, and the writer refuses values that are not
  /// valid. Null: not written.
  void (*write)(const SplatCloud& cloud, const std::string& path, const SplatWriteOptions& options,
                Progress* progress);
  bool checks_values = false;     ///< with a RowCheck, which saves a pass through memory
  bool takes_any_degree = false;  ///< passes over higher harmonics itself, without a copy
};

/// All formats, in the order in which files are tried.
const std::vector<SplatFormat>& splatFormats();

/// The format that a file's content has, or its ending where the format has no first bytes of its
/// own; null for files of no format that can be read. Errors: kIo.
const SplatFormat* splatFormatOfContent(const std::string& path);

/// The format whose ending the path has (the longest that fits), or null.
const SplatFormat* splatFormatOfEnding(const std::string& path);

}  // namespace stipple
