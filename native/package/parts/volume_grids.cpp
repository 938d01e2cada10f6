// OpenVDB's start with the two types of grids that volumes of ours have. Its own start makes all of
// them, which takes ten minutes to compile and most of the library's size.
#include <blosc.h>
#include <openvdb/openvdb.h>

#include <mutex>

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {

namespace {

template <typename Type>
struct RegisterMetadata {
  void operator()() { Type::registerType(); }
};
template <typename Type>
struct RegisterMap {
  void operator()() { Type::registerMap(); }
};

std::mutex& startMutex() {
  static std::mutex mutex;
  return mutex;
}
bool is_started = false;

}  // namespace

void initialize() {
  const std::lock_guard<std::mutex> lock(startMutex());
  if (is_started) return;
  Metadata::clearRegistry();
  MetaTypes::foreach<RegisterMetadata>();
  math::MapRegistry::clear();
  MapTypes::foreach<RegisterMap>();
  GridBase::clearRegistry();
  FloatGrid::registerGrid();
  Vec3SGrid::registerGrid();
  blosc_init();
  blosc_set_compressor("lz4");
  is_started = true;
}

void uninitialize() {
  const std::lock_guard<std::mutex> lock(startMutex());
  Metadata::clearRegistry();
  GridBase::clearRegistry();
  math::MapRegistry::clear();
  is_started = false;
}

}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
