#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/splats/splat_format.h"

namespace stipple {

/// True for a file named lod-meta.json and for a folder with one.
bool startsAsSogLevels(const SplatFileStart& start);

/// Reads the finest level of a streamed SOG scene, then its environment, as one cloud.
/// In: path, the lod-meta.json or its folder. Errors: as readSog.
SplatCloud readSogLevels(const std::string& path, Progress* progress);

struct SogLevelsOptions {
  /// A chunk of space is split while it holds more splats than this, all levels together; a file
  /// takes chunks of one level until it holds as many.
  size_t chunk_splats = 512 * 1024;
  /// ... or while it is longer than this, in the unit of the positions.
  double chunk_side = 16.0;
};

/// Writes a streamed SOG scene: every level in files of its own, cut along one tree of chunks, from
/// which viewers choose level by level what to load. In: levels, finest first, of one colour space,
/// filter and frame, at least one; environment, drawn at every level, or null; path, the
/// lod-meta.json, whose folder must be there. The files of a scene that was there before are
/// removed after the new lod-meta.json has replaced the old.
void writeSogLevels(const std::vector<const SplatCloud*>& levels, const SplatCloud* environment,
                    const std::string& path, const SogLevelsOptions& options, Progress* progress);

}  // namespace stipple
