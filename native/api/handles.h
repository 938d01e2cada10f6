#pragma once

#include <stipple/stipple.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "base/memory_limit.h"
#include "data/clouds/seen_cloud.h"
#include "data/clouds/splat_cloud.h"
#include "data/clouds/splat_quantities.h"
#include "data/images/image.h"
#include "data/images/image_channel.h"
#include "data/meshes/tri_mesh.h"
#include "data/sparse_volume.h"
#include "data/views/memory_view_source.h"
#include "density/density_model.h"
#include "io/assets/weights_folder.h"
#include "io/assets/weights_place.h"
#include "io/views/camera_file.h"
#include "io/views/series.h"
#include "measure/picture_accuracy.h"
#include "model/splat_model.h"
#include "motion/surface_binding.h"
#include "shot/mesh_layers.h"
#include "shot/renderer.h"
#include "train/backend/backend_table.h"

namespace stipple::api {

/// What a context carries; every handle made from it keeps a share.
struct ContextState : MemoryLimit {
  uint32_t thread_count = 0;
  /// What draws and differentiates, for fits and images alike.
  std::shared_ptr<const BackendFactory> backends = chosenBackends();
  /// Where assets find the weights that they name; "": nobody has said.
  std::shared_ptr<WeightsPlace> weights = std::make_shared<WeightsPlace>();
};
using Context = std::shared_ptr<const ContextState>;

/// What is known of a view beside its camera; texts are handed out as they lie here.
struct ViewNote {
  std::string name;
  std::string image_path;
  const char* camera_model = "";
  StippleViewSplit split = STIPPLE_VIEW_SPLIT_NONE;
  uint32_t source_width = 0;
  uint32_t source_height = 0;
  bool is_distorted = false;
  double time = 0;  ///< seconds
};

}  // namespace stipple::api

/* A handle is a small object that holds shares; freeing it never takes away what a job uses. */

struct StippleContext {
  stipple::api::Context state;
};

struct StippleCloud {
  stipple::api::Context context;
  std::shared_ptr<const stipple::SplatCloud> cloud;
  std::shared_ptr<const stipple::SplatQuantities> seen = {};  ///< null: nothing is known
  /// rowsAreValid() has accepted the cloud, which never changes: drawing need not ask again.
  mutable std::atomic<bool> is_checked{false};
};

/// A mesh grows by its add functions until a job takes a share; later additions copy first.
struct StippleMesh {
  stipple::api::Context context;
  std::shared_ptr<stipple::TriMesh> mesh;
};

struct StippleDensity {
  stipple::api::Context context;
  std::shared_ptr<const stipple::DensityModel> density;
};

struct StippleModel {
  stipple::api::Context context;
  std::shared_ptr<const stipple::SplatModel> model;
};

/// Cameras alone have no source. Pictures handed in are added until a job takes a share of the
/// source; later additions go to a copy, which shares the pictures.
struct StippleViews {
  stipple::api::Context context;
  std::vector<stipple::CameraView> cameras;           ///< where there is no source
  std::shared_ptr<const stipple::ViewSource> source;  ///< null: cameras alone
  std::shared_ptr<stipple::MemoryViewSource> memory;  ///< the source, where it can grow
  std::deque<stipple::api::ViewNote> notes;           ///< one for each view
  stipple::SeriesSize series;                         ///< of a data set
};

struct StippleRenderer {
  stipple::api::Context context;
  std::shared_ptr<stipple::Renderer> renderer;  ///< jobs hold a share
};

struct StippleVolume {
  stipple::api::Context context;
  std::shared_ptr<const stipple::SparseVolume> volume;
};

struct StippleImage {
  stipple::api::Context context;
  std::shared_ptr<const stipple::Image> image;
};

struct StippleImageChannels {
  stipple::api::Context context;
  std::shared_ptr<const std::vector<stipple::ImageChannel>> channels;
};

struct StippleLayers {
  stipple::api::Context context;
  stipple::MeshLayers layers;
};

struct StippleWeights {
  stipple::api::Context context;
  std::shared_ptr<const stipple::WeightsFolder> folder;
};

struct StippleBinding {
  stipple::api::Context context;
  std::shared_ptr<const stipple::SurfaceBinding> binding;
};

struct StippleAccuracyReport {
  std::shared_ptr<const stipple::MeasuredAccuracy> result;
};
