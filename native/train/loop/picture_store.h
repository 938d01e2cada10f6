#pragma once

#include <cstddef>
#include <cstdint>
#include <future>
#include <memory>
#include <vector>

#include "data/views/packed_picture.h"
#include "data/views/view_source.h"
#include "math/camera.h"

namespace stipple {

/// A view as the loss looks at it.
struct TargetPicture {
  uint32_t width = 0;
  uint32_t height = 0;
  std::vector<float> colour;   ///< [H,W,3] over the background, in the compositing space
  std::vector<float> alpha;    ///< [H,W]; empty: 1 everywhere
  std::vector<float> weights;  ///< [H,W]; empty: 1 everywhere
};

/// The same view in blocks of `factor` x `factor` pixels, each with the mean of what it holds,
/// where weights count; what is left over at the right and the bottom is cut off. camera: of the
/// picture, becomes that of the blocks.
void reducePicture(uint32_t factor, TargetPicture& picture, Camera& camera);

/// The pictures of views, packed in memory up to a limit; what comes after it is loaded whenever it
/// is wanted, so that sets of any size can be fitted. A picture comes out the same whether it was
/// kept or not. What a source has in memory already is shared with it. One call at a time.
class PictureStore {
 public:
  PictureStore(std::shared_ptr<const ViewSource> views, uint64_t byte_limit);
  ~PictureStore();

  const ViewSource& views() const { return *views_; }

  /// Begins to load a view on another thread, where it is not kept. At most one waits.
  void prefetch(size_t view);

  /// Out: target, whose arrays are used again. In: background, [3] in the compositing space.
  /// Errors: those of ViewSource::load and validateView().
  void load(size_t view, const double background[3], TargetPicture& target);

  uint64_t bytes() const { return bytes_; }  ///< of the pictures that are kept

 private:
  std::shared_ptr<const PackedPicture> fetch(size_t view);
  /// Where there is room.
  void keep(size_t view, const std::shared_ptr<const PackedPicture>& made);

  std::shared_ptr<const ViewSource> views_;
  uint64_t byte_limit_;
  uint64_t bytes_ = 0;
  std::vector<std::shared_ptr<const PackedPicture>> kept_;  ///< by view; null: not kept
  size_t awaited_view_ = 0;
  std::future<std::shared_ptr<const PackedPicture>> awaited_;
};

}  // namespace stipple
