#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "data/views/view_source.h"
#include "train/backend/backend_factory.h"

namespace stipple {

struct AddDetailOptions {
  uint64_t max_splats = 0;  ///< of the result; 0: all splats become finer
  uint32_t view_count = 0;  ///< that the network is told of, spread evenly; 0: as it has learned
};

/// A cloud with detail that views show, in one pass of a network that a training with "detail" has
/// written. Opening it reads the weights, so that what is wrong with them is told at once.
class DetailAdding {
 public:
  /// Errors: kIo; kFormat for a file that is no safetensors or has tensors missing, of another size
  /// or not finite; kInvalidArgument for weights of others or of another network, options out of
  /// range, a cloud that validate() refuses or that is empty, views of another colour space, none,
  /// or more splats wanted than one pass can make or fewer than there are.
  DetailAdding(std::shared_ptr<const BackendFactory> backends,
               std::shared_ptr<const SplatCloud> cloud, std::shared_ptr<const ViewSource> views,
               const std::string& weights_path, const AddDetailOptions& options);
  ~DetailAdding();

  /// About what run() allocates, bytes.
  uint64_t memoryBound() const;
  /// Splats that stay, in their order, then finer ones. Errors: kInvalidArgument where no view
  /// shows any splat; those of reading images; kCancelled. Threads and determinism: the same bits
  /// for any number of threads. Cost: for each view three drawings and a backward pass, and the
  /// network once.
  SplatCloud run(Progress* progress = nullptr) const;

 private:
  struct Network;

  std::shared_ptr<const BackendFactory> backends_;
  std::shared_ptr<const SplatCloud> cloud_;
  std::shared_ptr<const ViewSource> views_;
  std::unique_ptr<const Network> network_;
  uint64_t points_ = 0;  ///< splats that become finer
  size_t view_count_ = 0;
};

}  // namespace stipple
