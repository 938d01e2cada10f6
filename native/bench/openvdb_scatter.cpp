#include "bench/openvdb_scatter.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/PointScatter.h>

#include <random>

#include "math/morton.h"

namespace stipple::bench {
namespace {

struct PointList {
  std::vector<openvdb::Vec3s> points;
  void add(const openvdb::Vec3R& position) { points.emplace_back(position); }
};

}  // namespace

struct OpenvdbScatter::Grid {
  openvdb::FloatGrid::Ptr values;
  PointList list;  // kept from call to call: the peer does not pay for memory
};

OpenvdbScatter::OpenvdbScatter(const std::vector<uint64_t>& leaves,
                               const std::vector<double>& probabilities)
    : grid_(std::make_unique<Grid>()) {
  openvdb::initialize();
  grid_->values = openvdb::FloatGrid::create(0.0f);
  auto accessor = grid_->values->getAccessor();
  for (size_t i = 0; i < leaves.size(); ++i) {
    const auto [x, y, z] = mortonDecode(leaves[i]);
    accessor.setValue(openvdb::Coord(static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)),
                      static_cast<float>(probabilities[i] * 1e6));
  }
}

OpenvdbScatter::~OpenvdbScatter() = default;

size_t OpenvdbScatter::scatter(uint64_t count) {
  PointList& list = grid_->list;
  list.points.clear();
  list.points.reserve(count + count / 64);
  std::mt19937_64 random(1);
  openvdb::tools::NonUniformPointScatter<PointList, std::mt19937_64> scatter(
      list, static_cast<float>(static_cast<double>(count) * 1e-6), random);
  scatter(*grid_->values);
  return list.points.size();
}

}  // namespace stipple::bench
