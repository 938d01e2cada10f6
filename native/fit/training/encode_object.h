#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/progress.h"
#include "model/splat_model.h"

namespace stipple {

/// What encodeObject() reads.
struct EncodeRequest {
  std::string weights_path;  ///< a file that a training wrote
  /// The folder of an object as collections have them, of which the points are read, or a .ply of
  /// points with colours.
  std::string object_path;
  uint64_t tokens = 0;  ///< of the latent, at most as many as points; 0: as many as were learned
};

/// An object becomes a latent, which decodes to splats at any budget, where the object was.
/// Errors: kIo, kFormat of both files; kInvalidArgument for weights that were not trained here,
/// points without colours or extent, tokens out of range; kCancelled. Threads and determinism: the
/// same bits for any number of threads.
std::shared_ptr<const SplatModel> encodeObject(const EncodeRequest& request,
                                               Progress* progress = nullptr);

/// About what that allocates, bytes. Errors: of the weights' file.
uint64_t encodeMemoryBound(const EncodeRequest& request);

}  // namespace stipple
