#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/commands.h"
#include "cli/dataset.h"
#include "cli/numbers.h"
#include "cli/report.h"

namespace stipple::cli {

namespace {

const std::vector<std::pair<const char*, uint32_t>> kDensities = {
    {"off", STIPPLE_MESH_DENSITY_OFF},
    {"uniform", STIPPLE_MESH_DENSITY_UNIFORM},
    {"adaptive", STIPPLE_MESH_DENSITY_ADAPTIVE}};
const std::vector<std::pair<const char*, uint32_t>> kAlignments = {
    {"none", STIPPLE_MESH_ALIGN_NONE},
    {"size", STIPPLE_MESH_ALIGN_SIZE},
    {"rigid", STIPPLE_MESH_ALIGN_RIGID},
    {"similarity", STIPPLE_MESH_ALIGN_SIMILARITY}};
const std::vector<std::pair<const char*, uint32_t>> kDrawings = {
    {"triangles", STIPPLE_PICTURE_DRAWING_TRIANGLES}, {"splats", STIPPLE_PICTURE_DRAWING_SPLATS}};

/// Of the density, to images: what they say of a surface is weaker than what a surface says.
constexpr double kImagesStrength = 0.3;

StippleMeshAdaptOptions defaults() {
  StippleMeshAdaptOptions options;
  stipple_mesh_adapt_options_init(&options);
  return options;
}

struct Arguments {
  std::string in, target, out, density, align = "none", draw = "triangles";
  std::vector<std::string> landmarks;
  StippleMeshAdaptOptions options = defaults();
  int64_t steps = options.steps;
  int64_t points = static_cast<int64_t>(options.target_count);
  int64_t image_size = options.picture_side;
  std::optional<double> strength;
  bool json = false;
};

uint32_t chosen(const std::vector<std::pair<const char*, uint32_t>>& names, const std::string& name,
                const char* flag) {
  std::string known;
  for (const auto& [each, value] : names) {
    if (name == each) return value;
    known += (known.empty() ? "" : ", ") + std::string(each);
  }
  throw Failure(std::string(flag) + " is '" + name + "'; " + known + " are allowed");
}

struct Landmarks {
  std::vector<uint32_t> vertices;
  std::vector<float> places;
};

/// "VERTEX:X,Y,Z" each.
Landmarks landmarksOf(const std::vector<std::string>& texts) {
  Landmarks made;
  for (const std::string& text : texts) {
    uint32_t vertex = 0;
    float x = 0, y = 0, z = 0;
    int read = 0;
    const bool is_whole =
        std::sscanf(text.c_str(), "%u:%f,%f,%f%n", &vertex, &x, &y, &z, &read) == 4 &&
        static_cast<size_t>(read) == text.size() && text[0] != '-';
    if (!is_whole) {
      throw Failure(
          "--landmark is '" + text +
          "'; VERTEX:X,Y,Z is expected, a vertex of the template and its place in metres");
    }
    made.vertices.push_back(vertex);
    made.places.insert(made.places.end(), {x, y, z});
  }
  return made;
}

/// What the template is fitted to, and what holds it.
struct Target {
  Mesh mesh;
  Cloud cloud;
  std::string points;  ///< path of a file of them
  Views views;

  StippleMeshAdaptTarget given() const {
    auto target = sized<StippleMeshAdaptTarget>();
    target.mesh = mesh.get();
    target.cloud = cloud.get();
    target.views = views.get();
    target.points_path_utf8 = points.empty() ? nullptr : points.c_str();
    return target;
  }
};

/// True for a PLY file whose vertices have no sizes: points of a scan, or vertices of a mesh.
bool isPlyOfPoints(const std::string& path) {
  std::ifstream file(std::filesystem::path(path), std::ios::binary);
  std::string line;
  if (!std::getline(file, line) || !line.starts_with("ply")) return false;
  constexpr size_t kMostLines = 4096;
  for (size_t i = 0; i < kMostLines && std::getline(file, line); ++i) {
    if (line.starts_with("end_header")) return true;
    if (line.find(" scale_0") != std::string::npos || line.find(" packed_") != std::string::npos) {
      return false;
    }
  }
  return false;
}

Target targetOf(const Context& context, const std::string& path) {
  Target target;
  const FileKind kind = fileKind(path);
  if (kind == FileKind::kMesh) {
    target.mesh = make<Mesh>(stipple_mesh_load, context.get(), path.c_str());
  } else if (kind == FileKind::kSplats && isPlyOfPoints(path)) {
    target.points = path;
  } else if (kind == FileKind::kSplats) {
    target.cloud = make<Cloud>(stipple_cloud_load, context.get(), path.c_str());
  } else if (kind == FileKind::kViews) {
    target.views = openViews(context, path, 1);
  } else {
    throw Failure("'" + path +
                  "' is neither a mesh nor points, splats or images with cameras; a template takes "
                  "the shape of "
                  "one");
  }
  return target;
}

void requireMeshExtension(const std::string& path) {
  for (const char* extension : {".glb", ".ply"}) {
    if (path.ends_with(extension)) return;
  }
  throw Failure("'" + path + "' cannot be written as a mesh; .glb or .ply is expected");
}

void addFigures(Report& report, const StippleMeshAdaptReport& figures, bool is_of_views) {
  report.add("places", figures.place_count);
  report.add("loose_vertices", figures.loose_count);
  report.add("turned_normals", figures.turned_normals != 0 ? "yes" : "no");
  if (is_of_views) {
    report.add("difference_before", figures.picture_before);
    report.add("difference_after", figures.picture_after);
    return;
  }
  report.add("distance_before", figures.distance_before);
  report.add("distance_after", figures.distance_after);
  if (figures.has_normals == 0) return;
  report.add("normals_before", figures.normals_before);
  report.add("normals_after", figures.normals_after);
}

void adapt(const Context& context, Arguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  requireMeshExtension(arguments.out);
  StippleMeshAdaptOptions& options = arguments.options;
  options.alignment = chosen(kAlignments, arguments.align, "--align");
  options.steps = counted32(arguments.steps, "--steps");
  options.target_count = counted(arguments.points, "--points");
  options.picture_side = counted32(arguments.image_size, "--image-size");
  options.picture_drawing = chosen(kDrawings, arguments.draw, "--draw");
  const Landmarks landmarks = landmarksOf(arguments.landmarks);
  options.landmark_count = landmarks.vertices.size();
  options.landmark_vertices = landmarks.vertices.data();
  options.landmark_places = landmarks.places.data();
  const auto given = make<Mesh>(stipple_mesh_load, context.get(), arguments.in.c_str());
  const Target target = targetOf(context, arguments.target);
  const StippleMeshAdaptTarget aim = target.given();
  const char* usual = target.views ? "off" : "adaptive";
  options.strength = arguments.strength.value_or(target.views ? kImagesStrength : options.strength);
  options.density =
      chosen(kDensities, arguments.density.empty() ? usual : arguments.density, "--density");
  const auto job = make<Job>(stipple_mesh_adapt_start, const_cast<const StippleMesh*>(given.get()),
                             &aim, const_cast<const StippleMeshAdaptOptions*>(&options));
  finish(job);
  const auto made = make<Mesh>(stipple_job_mesh, const_cast<const StippleJob*>(job.get()));
  auto figures = sized<StippleMeshAdaptReport>();
  check(stipple_job_adapt_report(job.get(), &figures));
  if (arguments.out.ends_with(".glb")) {
    check(stipple_mesh_save_reshaped(made.get(), arguments.in.c_str(), arguments.out.c_str()));
  } else {
    check(stipple_mesh_save(made.get(), arguments.out.c_str()));
  }
  auto info = sized<StippleMeshInfo>();
  check(stipple_mesh_info(made.get(), &info));
  Report report;
  report.add("vertices", info.vertex_count);
  report.add("triangles", info.triangle_count);
  addFigures(report, figures, static_cast<bool>(target.views));
  report.add("seconds", secondsSince(start));
  report.print(arguments.json);
}

void addWeights(CLI::App& command, Arguments& arguments) {
  StippleMeshAdaptOptions& options = arguments.options;
  command.add_option("--strength", arguments.strength,
                     "Of the density; 0: none; default: 1.5, to images 0.3");
  command
      .add_option("--smoothness", options.smoothness,
                  "Larger: broader steps, and detail that comes later")
      ->capture_default_str();
  command
      .add_option("--normal-weight", options.normal_weight,
                  "How much directions of the surface count beside distances")
      ->capture_default_str();
  command
      .add_option("--symmetric-weight", options.symmetric_weight,
                  "How much the way from template to target counts as well")
      ->capture_default_str();
  command
      .add_option("--landmark-weight", options.landmark_weight,
                  "How much the landmarks count together")
      ->capture_default_str();
}

}  // namespace

void addAdapt(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "adapt",
      "A mesh takes the shape of another, of points, splats or images, and keeps its triangles");
  command->add_option("template", arguments->in, "Mesh (.gltf, .glb) whose vertices move")
      ->required();
  command
      ->add_option(
          "target", arguments->target,
          "Mesh (.gltf, .glb), points (.ply), splat file, or data set of images with alpha or "
          "masks")
      ->required();
  command
      ->add_option("out", arguments->out,
                   "Mesh: .glb with all that the template's file holds, or .ply with positions and "
                   "triangles in its order")
      ->required();
  command->add_option(
      "--density", arguments->density,
      "off, uniform (even edges) or adaptive (shorter ones where shape is complex); "
      "default: adaptive, to images off");
  command
      ->add_option("--align", arguments->align, "First as a whole: none, size, rigid or similarity")
      ->capture_default_str();
  command->add_option("--steps", arguments->steps, "More: closer")->capture_default_str();
  command->add_option("--points", arguments->points, "Of the target; more: finer detail, and time")
      ->capture_default_str();
  command
      ->add_option("--image-size", arguments->image_size,
                   "Of images: pixels of the longer side that are looked at")
      ->capture_default_str();
  command
      ->add_option(
          "--draw", arguments->draw,
          "What the template is drawn as beside images: triangles, or splats bound to them")
      ->capture_default_str();
  command->add_option("--landmark", arguments->landmarks,
                      "VERTEX:X,Y,Z: where a vertex of the template belongs, metres, Z up; "
                      "may be given several times");
  command->add_option("--seed", arguments->options.seed, "Of all samples")->capture_default_str();
  addWeights(*command, *arguments);
  command->add_flag("--json", arguments->json, "Figures as JSON");
  command->callback([arguments, &context] { adapt(context, *arguments); });
}

}  // namespace stipple::cli
