#include <filesystem>
#include <memory>
#include <vector>

#include "cli/commands.h"
#include "cli/formats.h"
#include "cli/hierarchy.h"

namespace stipple::cli {

namespace {

/// Each level of a streamed scene has a quarter of the splats of the finer one: half as many along
/// each side of a surface, as a viewer at twice the distance needs.
constexpr uint64_t kLevelRatio = 4;
/// Without --levels: no further level once one has at most this many splats, which any viewer
/// loads at once.
constexpr uint64_t kCoarsestCount = 20000;
constexpr uint64_t kDefaultLevels = 4;

struct Arguments {
  std::string in, out, frame;
  bool ascii = false, half = false;
  uint32_t degree = 4;
  uint32_t version = 0;
  int64_t levels = 0;
  bool levels_given = false;
};

/// Splats to convert, and the merge tree where the file held one.
struct Source {
  Cloud cloud;
  Model hierarchy;
  uint64_t count = 0;
};

Source sourceOf(const Context& context, const std::string& path) {
  Source source;
  if (!hasModelExtension(path)) {
    source.cloud = make<Cloud>(stipple_cloud_load, context.get(), path.c_str());
  } else {
    source.hierarchy = make<Model>(stipple_model_load, context.get(), path.c_str());
    auto settings = sized<StippleModelSettings>();
    check(stipple_model_settings(source.hierarchy.get(), &settings));
    if (settings.budget_unit != STIPPLE_BUDGET_SPLATS) {
      throw Failure("'" + path +
                    "' holds a model of any budget and no splats; stipple decode makes them");
    }
    if (settings.has_time) {
      throw Failure("'" + path +
                    "' holds splats that move; stipple decode --time makes those of one time");
    }
    source.cloud = cutOf(source.hierarchy, settings.maximum_budget);
  }
  auto info = sized<StippleCloudInfo>();
  check(stipple_cloud_info(source.cloud.get(), &info));
  source.count = info.count;
  return source;
}

/// Counts of the levels, finest first: each a quarter of the one before, rounded down.
std::vector<uint64_t> levelCounts(uint64_t count, const Arguments& arguments) {
  std::vector<uint64_t> all = {count};
  while (all.back() >= kLevelRatio) all.push_back(all.back() / kLevelRatio);
  if (!arguments.levels_given) {
    size_t levels = 1;
    while (levels < kDefaultLevels && all[levels - 1] > kCoarsestCount) ++levels;
    all.resize(levels);
    return all;
  }
  if (arguments.levels < 1 || static_cast<uint64_t>(arguments.levels) > all.size()) {
    throw Failure("--levels is " + std::to_string(arguments.levels) + "; 1 to " +
                  std::to_string(all.size()) + " is allowed for " + std::to_string(count) +
                  (count == 1 ? " splat" : " splats"));
  }
  all.resize(static_cast<size_t>(arguments.levels));
  return all;
}

/// Refuses a folder that is missing before a tree is built for it.
void requireFolder(const std::string& path) {
  const auto folder = std::filesystem::path(path).parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder)) {
    throw Failure("'" + path + "' cannot be written; '" + folder.string() + "' is not a folder");
  }
}

/// Writes the levels as cuts of one tree; level 0 is the splats as they are.
void saveLevels(const Context& context, Source source, const std::vector<uint64_t>& counts,
                const std::string& path, const StippleCloudSaveOptions& options) {
  if (counts.size() > 1 && source.hierarchy == nullptr) {
    source.hierarchy = hierarchyOf(context, source.cloud, 0);
  }
  std::vector<Cloud> cuts;
  std::vector<const StippleCloud*> levels = {source.cloud.get()};
  for (size_t i = 1; i < counts.size(); ++i) {
    cuts.push_back(cutOf(source.hierarchy, counts[i]));
    levels.push_back(cuts.back().get());
  }
  check(stipple_cloud_save_levels(levels.data(), levels.size(), nullptr, path.c_str(), &options));
}

void convert(const Context& context, const Arguments& arguments) {
  if (!hasSplatExtension(arguments.out)) {
    throw Failure("'" + arguments.out + "' is not a splat file; " + splatExtensions(true) +
                  " is expected");
  }
  const bool streamed = formatOfExtension(arguments.out) == "sog_levels";
  if (arguments.levels_given && !streamed) {
    throw Failure("--levels is of streamed scenes; '" + arguments.out +
                  "' is not named lod-meta.json");
  }
  StippleCloudSaveOptions options;
  stipple_cloud_save_options_init(&options);
  options.ascii = arguments.ascii ? 1 : 0;
  options.half = arguments.half ? 1 : 0;
  options.sh_degree_limit = arguments.degree;
  options.format_version = arguments.version;
  if (!arguments.frame.empty()) options.frame = frameOfName(arguments.frame);
  if (streamed) requireFolder(arguments.out);
  Source source = sourceOf(context, arguments.in);
  if (streamed) {
    const std::vector<uint64_t> counts = levelCounts(source.count, arguments);
    saveLevels(context, std::move(source), counts, arguments.out, options);
  } else {
    check(stipple_cloud_save(source.cloud.get(), arguments.out.c_str(), &options));
  }
}

}  // namespace

void addConvert(CLI::App& app, const Context& context) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("convert", "Any splat format to any other");
  command
      ->add_option("in", arguments->in,
                   "Splat file to read, or a hierarchy of splats (.stipple.safetensors)")
      ->required();
  command->add_option("out", arguments->out, "Splat file to write")->required();
  command->add_flag("--ascii", arguments->ascii, "Write a PLY as text");
  command->add_flag("--half", arguments->half,
                    "Write USD with all but positions in half precision");
  command
      ->add_option("--degree", arguments->degree, "Leave out harmonics above this degree, 0 to 4")
      ->capture_default_str();
  command
      ->add_option("--format-version", arguments->version,
                   "Version of the format to write (SPZ: 3 or 4); 0: the newest")
      ->capture_default_str();
  command->add_option(
      "--frame", arguments->frame,
      "Frame that positions are written in, such as RDF, RUB or RFU; without it the "
      "format's own");
  auto* levels =
      command->add_option("--levels", arguments->levels,
                          "Levels of a streamed scene (lod-meta.json), each a quarter of the one "
                          "before; without it up to 4, until one has 20,000 splats or fewer");
  command->callback([arguments, levels, &context] {
    arguments->levels_given = levels->count() > 0;
    convert(context, *arguments);
  });
}

}  // namespace stipple::cli
