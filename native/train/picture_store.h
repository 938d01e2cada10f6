#pragma once

#include <cstddef>
#include <cstdint>
#include <future>
#include <memory>
#include <vector>

#include "data/view_source.h"

namespace stipple {

/// Numbers of a picture in as few bytes as keep them: 1 where all are whole 255ths, as those of
/// 8-bit files are; 2, off by at most 1/131070, where all lie in 0..1; else 4.
class PackedNumbers {
 public:
  void pack(const std::vector<float>& values);
  size_t size() const { return bytes_.size() / width_; }
  uint64_t byteCount() const { return bytes_.size(); }
  /// Out: values [size()].
  void unpack(std::vector<float>& values) const;

 private:
  size_t width_ = 1;  ///< bytes of a number
  std::vector<uint8_t> bytes_;
};

/// A view as the loss looks at it.
struct TargetPicture {
  uint32_t width = 0;
  uint32_t height = 0;
  std::vector<float> colour;   ///< [H,W,3] over the background, in the compositing space
  std::vector<float> alpha;    ///< [H,W]; empty: 1 everywhere
  std::vector<float> weights;  ///< [H,W]; empty: 1 everywhere
};

/// The pictures of views, packed in memory up to a limit; what comes after it is loaded whenever it
/// is wanted, so that sets of any size can be fitted. A picture comes out the same whether it was
/// kept or not. One call at a time.
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
  struct Packed {
    uint32_t width = 0;
    uint32_t height = 0;
    PackedNumbers colour, alpha, weights;
    uint64_t byteCount() const {
      return colour.byteCount() + alpha.byteCount() + weights.byteCount();
    }
  };
  std::shared_ptr<const Packed> packed(size_t view) const;
  std::shared_ptr<const Packed> fetch(size_t view);

  std::shared_ptr<const ViewSource> views_;
  uint64_t byte_limit_;
  uint64_t bytes_ = 0;
  std::vector<std::shared_ptr<const Packed>> kept_;  ///< by view; null: not kept
  size_t awaited_view_ = 0;
  std::future<std::shared_ptr<const Packed>> awaited_;
};

}  // namespace stipple
