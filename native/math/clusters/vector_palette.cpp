// Based on: Lloyd, Least Squares Quantization in PCM, 1982, and Gersho and Gray, Vector
// Quantization and Signal Compression, 1992, section 12.4 (tree-structured search). Differs: after
// the two levels every vector is compared with the palettes of its nearest cells, not only of its
// own, and the palette moves again, which takes back most of what the tree costs.
#include "math/clusters/vector_palette.h"

#include <Eigen/Core>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "base/random.h"
#include "math/clusters/centre_search.h"
#include "math/radix_order.h"

namespace stipple {

namespace {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstMap = Eigen::Map<const Matrix>;

// Vectors that are gathered at a time: 46 KB of width 45, which stay in the second cache.
constexpr size_t kBlock = 256;
// Cells are placed by a sample of this many vectors each.
constexpr size_t kSamplePerCell = 128;
constexpr int kCellRounds = 10;
// Cells whose palettes a vector is compared with in the end; as many as NearestTwo holds.
constexpr size_t kProbes = 2;
constexpr int kFinalRounds = 1;

struct Best {
  float distance;  ///< squared and halved
  uint32_t index;
};

/// Centres around an origin: near centres of far vectors would lose their difference to rounding
/// otherwise.
struct Centres {
  Eigen::RowVectorXf origin;
  Matrix rows;  ///< relative to the origin
  CentreTable table;

  void measure() { table = CentreTable(rows.data(), count(), static_cast<size_t>(rows.cols())); }
  size_t count() const { return static_cast<size_t>(rows.rows()); }
};

/// The nearest centres of gathered vectors.
class Scorer {
 public:
  explicit Scorer(size_t width) : width_(width), found_(kBlock) {}

  /// In: index(k), which vector is the k-th; use(k, nearest, half_square) takes each: with the
  /// vector's own half square, scores are halved squared distances.
  template <typename Index, typename Use>
  void run(const float* vectors, size_t count, const Centres& centres, const Index& index,
           const Use& use) {
    const CentreSearch search = chosenCentreSearch();
    for (size_t begin = 0; begin < count; begin += kBlock) {
      const size_t rows = std::min(kBlock, count - begin);
      gathered_.resize(Eigen::Index(rows), Eigen::Index(width_));
      for (size_t k = 0; k < rows; ++k) {
        std::memcpy(gathered_.data() + k * width_, vectors + index(begin + k) * width_,
                    width_ * sizeof(float));
      }
      gathered_.rowwise() -= centres.origin;
      search(gathered_.data(), rows, centres.table, found_.data());
      for (size_t k = 0; k < rows; ++k) {
        use(begin + k, found_[k], 0.5f * gathered_.row(Eigen::Index(k)).squaredNorm());
      }
    }
  }

 private:
  size_t width_;
  Matrix gathered_;
  std::vector<NearestTwo> found_;
};

Best nearestOf(const NearestTwo& found, float half_square) {
  return {std::max(0.0f, half_square + found.score[0]), found.index[0]};
}

/// Numbers 0..n-1 grouped by key, ascending inside a group.
struct Groups {
  std::vector<size_t> first;  ///< [keys + 1]
  std::vector<uint32_t> members;

  template <typename Key>
  Groups(size_t n, size_t keys, const Key& key) : first(keys + 1, 0), members(n) {
    for (size_t i = 0; i < n; ++i) ++first[key(i) + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    std::vector<size_t> next(first.begin(), first.end() - 1);
    for (size_t i = 0; i < n; ++i) members[next[key(i)]++] = static_cast<uint32_t>(i);
  }
  size_t size(size_t key) const { return first[key + 1] - first[key]; }
  const uint32_t* begin(size_t key) const { return members.data() + first[key]; }
};

class PaletteMaker {
 public:
  PaletteMaker(const float* vectors, size_t n, size_t width, const PaletteOptions& options,
               Progress* progress)
      : vectors_(vectors), n_(n), width_(width), options_(options), progress_(progress) {}

  VectorPalette make() {
    if (keepAll()) return std::move(palette_);
    placeCells();
    fillCells();
    for (int round = 0; round < kFinalRounds; ++round) {
      assignNearest();
      move();
      advance(progress_, 0.8 + 0.2 * (round + 1) / (kFinalRounds + 1), kStage);
    }
    assignNearest();
    return std::move(palette_);
  }

 private:
  static constexpr char kStage[] = "Choosing a palette";

  const float* vector(size_t i) const { return vectors_ + i * width_; }
  bool same(size_t a, size_t b) const {
    return std::memcmp(vector(a), vector(b), width_ * sizeof(float)) == 0;
  }

  /// The palette of all different vectors, where they are few enough.
  bool keepAll() {
    KeyedIndices order(n_);
    parallelFor(n_, kBlock * 16, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        uint64_t hash = 0;
        for (size_t k = 0; k < width_; ++k) {
          uint32_t bits = 0;
          std::memcpy(&bits, vector(i) + k, sizeof(bits));
          hash = mixBits(hash ^ bits);
        }
        order[i] = {hash, static_cast<uint32_t>(i)};
      }
    });
    sortByKey(order);
    palette_.labels.resize(n_);
    std::vector<uint32_t> kept;
    for (size_t k = 0; k < n_; ++k) {
      // Different vectors of one hash would part a group and cost an entry, never an error.
      if (k == 0 || order[k].key != order[k - 1].key || !same(order[k].index, kept.back())) {
        if (kept.size() == options_.max_count) return false;
        kept.push_back(order[k].index);
      }
      palette_.labels[order[k].index] = static_cast<uint16_t>(kept.size() - 1);
    }
    palette_.count = kept.size();
    for (const uint32_t i : kept) {
      palette_.vectors.insert(palette_.vectors.end(), vector(i), vector(i) + width_);
    }
    return true;
  }

  /// Different numbers below n, spread by chance; always the same for a seed.
  std::vector<uint32_t> choose(size_t n, size_t count, uint64_t what) const {
    std::vector<std::pair<uint64_t, uint32_t>> keys(n);
    for (size_t i = 0; i < n; ++i) {
      keys[i] = {keyedBits(options_.seed, RandomUse::kPalette, what << 32 | i),
                 static_cast<uint32_t>(i)};
    }
    std::nth_element(keys.begin(), keys.begin() + static_cast<std::ptrdiff_t>(count) - 1,
                     keys.end());
    keys.resize(count);
    std::sort(keys.begin(), keys.end());
    std::vector<uint32_t> chosen;
    for (const auto& key : keys) chosen.push_back(key.second);
    return chosen;
  }

  /// Puts the centres where some of the vectors are.
  void place(Centres& centres, const std::vector<uint32_t>& at) const {
    centres.rows.resize(Eigen::Index(at.size()), Eigen::Index(width_));
    for (size_t k = 0; k < at.size(); ++k) {
      centres.rows.row(Eigen::Index(k)) =
          ConstMap(vector(at[k]), 1, Eigen::Index(width_)) - centres.origin;
    }
    centres.measure();
  }

  /// Mean of the vectors index(0..count-1), relative to an origin.
  template <typename Index>
  Eigen::RowVectorXf mean(size_t count, const Index& index,
                          const Eigen::RowVectorXf& origin) const {
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(Eigen::Index(width_));
    for (size_t k = 0; k < count; ++k) {
      sum += ConstMap(vector(index(k)), 1, Eigen::Index(width_)).cast<double>();
    }
    return (sum / static_cast<double>(count) - origin.cast<double>()).cast<float>();
  }

  /// Moves every centre to the mean of its members; one without members to the member that is worst
  /// served, so that no place is lost. In: best [members], what each belongs to.
  template <typename Index>
  void moveCentres(Centres& centres, size_t count, const std::vector<Best>& best,
                   const Index& index) const {
    const Groups groups(count, centres.count(), [&](size_t k) { return best[k].index; });
    std::vector<std::pair<float, uint32_t>> worst;
    for (size_t c = 0; c < centres.count(); ++c) {
      const size_t members = groups.size(c);
      if (members == 0) {
        if (worst.empty()) worst = worstServed(count, best, index);
        if (worst.empty()) continue;
        centres.rows.row(Eigen::Index(c)) =
            ConstMap(vector(index(worst.back().second)), 1, Eigen::Index(width_)) - centres.origin;
        worst.pop_back();
        continue;
      }
      centres.rows.row(Eigen::Index(c)) = mean(
          members, [&](size_t k) { return index(groups.begin(c)[k]); }, centres.origin);
    }
    centres.measure();
  }

  /// Members by the distance to their centre, the largest last; only those that are off it.
  template <typename Index>
  std::vector<std::pair<float, uint32_t>> worstServed(size_t count, const std::vector<Best>& best,
                                                      const Index&) const {
    std::vector<std::pair<float, uint32_t>> list;
    for (size_t k = 0; k < count; ++k) {
      if (best[k].distance > 0) list.push_back({best[k].distance, static_cast<uint32_t>(k)});
    }
    std::sort(list.begin(), list.end());
    return list;
  }

  /// First level: cells by k-means on a sample, then the cells nearest to every vector.
  void placeCells() {
    const size_t cells = std::max<size_t>(
        1, static_cast<size_t>(std::lround(std::sqrt(static_cast<double>(options_.max_count)))));
    const std::vector<uint32_t> sample = choose(n_, std::min(n_, cells * kSamplePerCell), 0);
    cells_.origin = mean(
        sample.size(), [&sample](size_t k) { return size_t{sample[k]}; },
        Eigen::RowVectorXf::Zero(Eigen::Index(width_)));
    place(cells_, {sample.begin(), sample.begin() + std::ptrdiff_t(cells)});
    std::vector<Best> best(sample.size());
    const auto index = [&sample](size_t k) { return size_t{sample[k]}; };
    for (int round = 0; round < kCellRounds; ++round) {
      parallelFor(sample.size(), kBlock * 4, [&](size_t begin, size_t end) {
        Scorer(width_).run(
            vectors_, end - begin, cells_, [&](size_t k) { return index(begin + k); },
            [&](size_t k, const NearestTwo& found, float half_square) {
              best[begin + k] = nearestOf(found, half_square);
            });
      });
      moveCentres(cells_, sample.size(), best, index);
    }
    probes_ = std::min(kProbes, cells);
    nearest_cells_.resize(n_ * probes_);
    parallelFor(n_, kBlock * 16, [&](size_t begin, size_t end) {
      Scorer(width_).run(
          vectors_, end - begin, cells_, [&](size_t k) { return begin + k; },
          [&](size_t k, const NearestTwo& found, float) {
            for (size_t p = 0; p < probes_; ++p) {
              nearest_cells_[(begin + k) * probes_ + p] = static_cast<uint16_t>(found.index[p]);
            }
          });
    });
    advance(progress_, 0.1, kStage);
  }

  /// Second level: each cell gets a share of the palette and k-means of its own.
  void fillCells() {
    const Groups groups(n_, cells_.count(),
                        [this](size_t i) { return nearest_cells_[i * probes_]; });
    shares_ = shareOut(groups);
    palettes_.resize(cells_.count());
    std::atomic<size_t> done{0};
    parallelFor(cells_.count(), 1, [&](size_t begin, size_t end) {
      for (size_t cell = begin; cell < end; ++cell) {
        fillCell(cell, groups);
        advance(progress_,
                0.1 + 0.7 * static_cast<double>(++done) / static_cast<double>(cells_.count()),
                kStage);
      }
    });
  }

  /// Places in the palette per cell: by the square root of vectors times squared distances, between
  /// equal numbers of vectors and equal errors. At most one per vector.
  std::vector<size_t> shareOut(const Groups& groups) const {
    const size_t cells = cells_.count();
    std::vector<double> errors(cells, 0.0);
    parallelFor(cells, 1, [&](size_t begin, size_t end) {
      for (size_t cell = begin; cell < end; ++cell) {
        for (size_t k = 0; k < groups.size(cell); ++k) {
          errors[cell] += static_cast<double>(
              (ConstMap(vector(groups.begin(cell)[k]), 1, Eigen::Index(width_)) - cells_.origin -
               cells_.rows.row(Eigen::Index(cell)))
                  .squaredNorm());
        }
      }
    });
    std::vector<double> wishes(cells);
    std::vector<size_t> shares(cells, 0);
    size_t left = options_.max_count;
    for (size_t cell = 0; cell < cells; ++cell) {
      wishes[cell] = std::sqrt(static_cast<double>(groups.size(cell)) * errors[cell]);
      // A cell of equal vectors wishes nothing and needs one place.
      if (groups.size(cell) > 0) shares[cell] = 1;
      left -= shares[cell];
    }
    // What full cells cannot take goes round again; each round fills a cell or ends.
    while (left > 0) {
      double total = 0;
      for (size_t cell = 0; cell < cells; ++cell) {
        if (shares[cell] < groups.size(cell)) total += wishes[cell];
      }
      if (!(total > 0)) break;
      const size_t before = left;
      const double per_wish = static_cast<double>(before) / total;
      for (size_t cell = 0; cell < cells; ++cell) {
        const size_t room = groups.size(cell) - std::min(shares[cell], groups.size(cell));
        const size_t more = std::min({room, left, static_cast<size_t>(wishes[cell] * per_wish)});
        shares[cell] += more;
        left -= more;
      }
      if (left == before) break;
    }
    return shares;
  }

  void fillCell(size_t cell, const Groups& groups) {
    const size_t count = groups.size(cell);
    Centres& palette = palettes_[cell];
    palette.origin = cells_.origin + cells_.rows.row(Eigen::Index(cell));
    if (count == 0) {
      palette.rows.resize(0, Eigen::Index(width_));
      palette.measure();
      return;
    }
    const uint32_t* members = groups.begin(cell);
    const auto index = [members](size_t k) { return size_t{members[k]}; };
    std::vector<uint32_t> start = choose(count, shares_[cell], cell + 1);
    for (uint32_t& k : start) k = members[k];
    place(palette, start);
    Scorer scorer(width_);
    std::vector<Best> best(count);
    for (int round = 0; round < options_.rounds; ++round) {
      scorer.run(vectors_, count, palette, index,
                 [&](size_t k, const NearestTwo& found, float half_square) {
                   best[k] = nearestOf(found, half_square);
                 });
      moveCentres(palette, count, best, index);
    }
  }

  /// The nearest of the palettes of each vector's nearest cells.
  void assignNearest() {
    const size_t pairs = n_ * probes_;
    const Groups visitors(pairs, cells_.count(),
                          [this](size_t pair) { return nearest_cells_[pair]; });
    std::vector<size_t> first(cells_.count() + 1, 0);
    for (size_t cell = 0; cell < cells_.count(); ++cell) {
      first[cell + 1] = first[cell] + palettes_[cell].count();
    }
    candidates_.resize(pairs);
    parallelFor(cells_.count(), 1, [&](size_t begin, size_t end) {
      for (size_t cell = begin; cell < end; ++cell) {
        if (palettes_[cell].count() == 0) {
          for (size_t k = 0; k < visitors.size(cell); ++k) {
            candidates_[visitors.begin(cell)[k]] = {std::numeric_limits<float>::infinity(), 0};
          }
          continue;
        }
        const uint32_t* members = visitors.begin(cell);
        Scorer(width_).run(
            vectors_, visitors.size(cell), palettes_[cell],
            [&](size_t k) { return members[k] / probes_; },
            [&](size_t k, const NearestTwo& found, float half_square) {
              Best best = nearestOf(found, half_square);
              best.index += static_cast<uint32_t>(first[cell]);
              candidates_[members[k]] = best;
            });
      }
    });
    best_.resize(n_);
    parallelFor(n_, kBlock * 16, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const Best* found =
            std::min_element(&candidates_[i * probes_], &candidates_[i * probes_] + probes_,
                             [](const Best& a, const Best& b) { return a.distance < b.distance; });
        best_[i] = *found;
        palette_.labels[i] = static_cast<uint16_t>(found->index);
      }
    });
    palette_.count = first.back();
    palette_.vectors.clear();
    for (const Centres& palette : palettes_) {
      const Matrix rows = palette.rows.rowwise() + palette.origin;
      palette_.vectors.insert(palette_.vectors.end(), rows.data(), rows.data() + rows.size());
    }
  }

  /// The whole palette to the means of the vectors that chose its rows.
  void move() {
    const Groups groups(n_, palette_.count, [this](size_t i) { return best_[i].index; });
    std::vector<size_t> first(cells_.count() + 1, 0);
    for (size_t cell = 0; cell < cells_.count(); ++cell) {
      first[cell + 1] = first[cell] + palettes_[cell].count();
    }
    parallelFor(cells_.count(), 1, [&](size_t begin, size_t end) {
      for (size_t cell = begin; cell < end; ++cell) {
        for (size_t c = first[cell]; c < first[cell + 1]; ++c) {
          if (groups.size(c) == 0) continue;
          palettes_[cell].rows.row(Eigen::Index(c - first[cell])) = mean(
              groups.size(c), [&](size_t k) { return size_t{groups.begin(c)[k]}; },
              palettes_[cell].origin);
        }
        palettes_[cell].measure();
      }
    });
  }

  const float* vectors_;
  size_t n_;
  size_t width_;
  PaletteOptions options_;
  Progress* progress_;
  VectorPalette palette_;
  Centres cells_;
  size_t probes_ = 0;
  std::vector<uint16_t> nearest_cells_;  ///< [n, probes_], nearest first
  std::vector<size_t> shares_;
  std::vector<Centres> palettes_;  ///< per cell
  std::vector<Best> candidates_;   ///< [n, probes_]
  std::vector<Best> best_;         ///< [n]
};

}  // namespace

VectorPalette makeVectorPalette(const float* vectors, size_t n, size_t width,
                                const PaletteOptions& options, Progress* progress) {
  return PaletteMaker(vectors, n, width, options, progress).make();
}

}  // namespace stipple
