#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "data/images/byte_image.h"
#include "fit/generate_options.h"
#include "io/assets/weights_folder.h"
#include "model/splat_model.h"
#include "train/backend/backend_factory.h"

namespace stipple {

/// What passed by at one place of the networks: for telling somebody else's results from ours.
struct StageValues {
  std::string name;
  uint64_t count = 0;
  double minimum = 0, maximum = 0, mean = 0, deviation = 0;
  double seconds = 0;  ///< from the stage before to this one
  /// Multiplications and additions of networks in these seconds; 0: not counted.
  double operations = 0;
};

/// How a generation is doing.
struct GenerateStatus {
  uint32_t step = 0;  ///< that are done
  uint32_t steps = 0;
  uint32_t resumed_step = 0;  ///< where it went on from a checkpoint; 0: it began
  uint32_t preview_step = 0;  ///< of the newest preview; 0: none yet
  double seconds = 0;
  double seconds_left = 0;  ///< by the steps that are done; 0: not known yet
  size_t stage_count = 0;
  double likeness = kNotMeasured;  ///< to the image, dB; NaN: not measured, or not yet

  static constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();
};

/// What a generation will take, about.
struct GenerateEstimate {
  double seconds = 0;
  double image_seconds = 0;  ///< of them for the image, which several seeds share
  double operations = 0;     ///< multiplications and additions
  uint64_t bytes = 0;        ///< of memory; weights, which are read from their files, come on top
  uint64_t weight_bytes = 0;
};

/// One image on its way to splats, or noise alone. run() works on one thread; all else may be
/// called by others at any time.
class GenerateSession {
 public:
  /// Looks through the weights folder and reads what of the networks is small.
  /// In: image: null: an object that no image tells of; mask: null, or as prepareImage() takes it;
  /// backends: where the result is compared with the image (image_likeness.h), where there is
  /// one; null: it is not, and colours cannot be matched.
  /// Errors: kInvalidArgument for options out of range; those of findWeights() and
  /// requireWeights(); kFormat for files whose networks do not fit together; those of
  /// requireCheckpointPlace(); kInvalidArgument where colours shall be matched without an image, or
  /// by networks that were not trained here.
  GenerateSession(std::optional<ByteImage> image, std::optional<ByteImage> mask,
                  const GenerateOptions& options,
                  std::shared_ptr<const BackendFactory> backends = nullptr);
  ~GenerateSession();

  /// What the image encoders said in another session is taken over, where it was of the same
  /// prepared image and by the same files; else this one asks them itself. Before run(). Sessions
  /// of several seeds then ask once. In: other: its run() may go on or have ended.
  void takeFeatures(const GenerateSession& other);
  /// About what run() allocates, bytes.
  uint64_t memoryBound() const;
  /// What a session takes on this machine, whose speed is measured by a short product of matrices,
  /// once. Errors: as the constructor, but for those of the image.
  static GenerateEstimate estimate(const GenerateOptions& options);

  /// The whole work. Errors: kCancelled; those of prepareImage(); kFormat for weights that make
  /// numbers that are not finite; kInvalidArgument for a checkpoint of another generation; kIo,
  /// kFormat of a checkpoint. Threads and determinism: same result for any number of threads, and
  /// whether it was interrupted or not.
  void run(Progress& progress);

  GenerateStatus status() const;
  /// It lives as long as the session. Errors: kInvalidArgument for an index out of range.
  const StageValues& stageAt(size_t index) const;
  /// The newest preview, which is given once; null: there is no newer one.
  std::shared_ptr<const SplatCloud> takePreview();
  /// The result for any budget. Errors: kInvalidArgument before run() has ended well.
  std::shared_ptr<const SplatModel> model() const;

 private:
  struct Work;

  std::unique_ptr<Work> work_;
};

}  // namespace stipple
