#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/splats/splat_format.h"

namespace stipple {

/// A zip archive, a file named meta.json, or a folder with one.
bool startsAsSog(const SplatFileStart& start);

/// Reads a SOG scene of version 1 or 2. In: path, a .sog (zip), a meta.json whose pictures lie
/// beside it, or the folder of that.
/// Errors: kIo, kFormat (file, key or splat, what is seen and allowed), kUnsupported.
SplatCloud readSog(const std::string& path, Progress* progress);
/// The same, one of many. Out: stored_bytes, of its images in their files.
SplatCloud readSogPart(const std::string& path, uint64_t& stored_bytes);

struct SogOptions {
  /// Rounds of moving the palette of harmonics; each takes as long as the last, and the first few
  /// gain most.
  int palette_rounds = 4;
  /// Along the Morton curve, which makes the pictures smaller; else in the order given.
  bool sort = true;
};

struct SogPart {
  std::string name;
  std::vector<uint8_t> bytes;
};

/// A SOG scene of version 2 in memory: its WebP pictures, then meta.json. Harmonics above degree 3
/// are left out. In: a cloud that validate() accepts.
std::vector<SogPart> encodeSog(const SplatCloud& cloud, const SogOptions& options,
                               Progress* progress);

/// Writes version 2: a zip for .sog, else meta.json at the path and its pictures beside it, which
/// are all written under temporary names before the first is renamed, meta.json last.
void writeSog(const SplatCloud& cloud, const std::string& path, const SogOptions& options,
              Progress* progress);

/// About how many bytes that is, of one scene or of its one level; images are packed, so scenes
/// differ.
double estimateSog(uint64_t count, int degree, const SplatWriteOptions& options);

}  // namespace stipple
