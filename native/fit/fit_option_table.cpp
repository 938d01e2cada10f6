#include "fit/fit_option_table.h"

#include <type_traits>

namespace stipple {

namespace {

constexpr double kMaxSplats = uint64_t{1} << 28;
constexpr double kMaxAnchors = uint64_t{1} << 28;
constexpr double kMax32 = std::numeric_limits<uint32_t>::max();
constexpr double kMebibyte = 1 << 20;

template <auto kMember>
FitValue valueOf(const FitOptions& options) {
  using T = std::remove_cvref_t<decltype(options.*kMember)>;
  if constexpr (std::is_same_v<T, std::string> || std::is_same_v<T, double>) {
    return options.*kMember;
  } else {
    return static_cast<uint64_t>(options.*kMember);
  }
}

template <auto kMember>
void setValue(FitOptions& options, const FitValue& value) {
  using T = std::remove_cvref_t<decltype(options.*kMember)>;
  if constexpr (std::is_same_v<T, std::string> || std::is_same_v<T, double>) {
    options.*kMember = std::get<T>(value);
  } else {
    options.*kMember = static_cast<T>(std::get<uint64_t>(value));
  }
}

template <auto kMember>
constexpr FitMember member() {
  return {valueOf<kMember>, setValue<kMember>};
}

// What is not named in a row is as FitOption has it. Presets: explicit, field, motion; each fast,
// balanced and fine detail; scaffold, relay. They are chosen by docs/methods/fitting.md.
const FitOption kTable[] = {
    {.name = "model",
     .kind = FitOptionKind::kChoice,
     .member = member<&FitOptions::model>(),
     .help =
         "The fit makes explicit splats, with parameters of their own, or a field, a learned "
         "density that decodes at any budget, or splats that move, of views with times, or a "
         "scaffold, anchors whose features networks turn into splats, or a relay of such anchors "
         "at key frames of a long clip.",
     .maximum = 4,
     .choices = "explicit,field,motion,scaffold,relay",
     .is_stored_as_word = true},
    {.name = "strategy",
     .kind = FitOptionKind::kText,
     .member = member<&FitOptions::strategy>(),
     .help = "The strategy says how splats are added and removed, as name(setting=number)+part.",
     .stored_of = kOfSplats,
     .presets = {{"adaptive", "improved", "improved"},
                 {"", "", ""},
                 {"temporal", "temporal", "temporal"}}},
    {.name = "start_splats",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::start_splats>(),
     .help = "The fit begins with this number of splats: at known points, and where images agree "
             "if those are too few; 0: all points; in photographs that makes 30,000 with "
             "others, and has up to 15,000 others where points leave images open. Of a scaffold "
             "these are anchors.",
     .models = kOfSplats | kOfScaffolds,
     .stored_of = kOfSplats | kOfScaffolds,
     .not_above = &FitOptions::max_splats,
     .aliases = {{"start"}}},
    {.name = "max_splats",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::max_splats>(),
     .help = "There are never more splats than this.",
     .models = kOfSplats,
     .stored_of = kOfSplats,
     .minimum = 1,
     .maximum = kMaxSplats,
     .presets = {{"50000", "150000", "500000"},
                 {"50000", "150000", "500000"},
                 {"50000", "150000", "500000"}},
     .aliases = {{"gaussians"}}},
    {.name = "min_anchors",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::least_anchors>(),
     .help = "This is the smallest budget of anchors that is trained.",
     .models = kOfField,
     .stored_of = kOfField,
     .minimum = 1,
     .maximum = kMaxAnchors,
     .not_above = &FitOptions::most_anchors,
     .presets = {{"1024", "1024", "1024"}, {"1024", "1024", "1024"}, {"1024", "1024", "1024"}},
     .stored_name = "least_anchors",
     .aliases = {{"least_anchors"}}},
    {.name = "max_anchors",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::most_anchors>(),
     .help = "This is the largest budget of anchors that is trained; a scaffold never has more.",
     .models = kOfAnchors,
     .stored_of = kOfAnchors,
     .minimum = 1,
     .maximum = kMaxAnchors,
     .presets = {{"8192", "16384", "32768"},
                 {"8192", "16384", "32768"},
                 {"8192", "16384", "32768"},
                 {"5000", "15000", "50000"},
                 {"5000", "10000", "20000"}},
     .stored_name = "most_anchors",
     .aliases = {{"most_anchors"}, {"anchors"}}},
    {.name = "gaussians_per_anchor",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::gaussians_per_anchor>(),
     .help = "Each anchor becomes this number of splats; fewer are better at an equal number of "
             "splats, and cost more. A scaffold's anchor has this number at most.",
     .models = kOfAnchors,
     .stored_of = kOfAnchors,
     .minimum = 4,
     .maximum = 32,
     .presets = {{"4", "4", "4"},
                 {"4", "4", "4"},
                 {"4", "4", "4"},
                 {"10", "10", "10"},
                 {"10", "10", "10"}}},
    {.name = "sh_degree",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::sh_degree>(),
     .help = "Spherical harmonics of colour go up to this degree; 0: colour does not depend on the "
             "view.",
     .maximum = kMaxShDegree,
     .presets =
         {{"3", "3", "3"}, {"0", "0", "0"}, {"3", "3", "3"}, {"2", "2", "2"}, {"1", "1", "1"}}},
    {.name = "antialias",
     .kind = FitOptionKind::kChoice,
     .member = member<&FitOptions::antialias>(),
     .help = "The splats are made for this way of smoothing edges.",
     .maximum = 1,
     .choices = "classic,mip",
     .presets = {{"classic", "classic", "classic"},
                 {"mip", "mip", "mip"},
                 {"classic", "classic", "classic"},
                 {"classic", "classic", "classic"},
                 {"classic", "classic", "classic"}}},
    {.name = "density_gradient",
     .kind = FitOptionKind::kSwitch,
     .member = member<&FitOptions::density_gradient>(),
     .help = "The density is learned from what each anchor does to the loss.",
     .models = kOfField,
     .stored_of = kOfField,
     .maximum = 1},
    {.name = "jitter",
     .kind = FitOptionKind::kSwitch,
     .member = member<&FitOptions::jitter>(),
     .help = "Anchors lie anywhere in their cells, not at the centres.",
     .models = kOfField,
     .stored_of = kOfField,
     .maximum = 1},
    {.name = "shell",
     .kind = FitOptionKind::kChoice,
     .member = member<&FitOptions::shell>(),
     .help = "A shell behind what is known holds what is far away; auto: where images are opaque.",
     .models = kOfField,
     .stored_of = kOfField,
     .maximum = 2,
     .choices = "auto,on,off"},
    {.name = "key_frame_spacing",
     .kind = FitOptionKind::kNumber,
     .member = member<&FitOptions::key_frame_spacing>(),
     .help = "So many seconds lie between the key frames of a relay.",
     .models = kOfRelay,
     .stored_of = kOfRelay,
     .minimum = 1e-6,
     .maximum = 1e9},
    {.name = "key_frame_blend",
     .kind = FitOptionKind::kChoice,
     .member = member<&FitOptions::key_frame_blend>(),
     .help = "Two key frames of a relay share the time between them by what is learned of each "
             "anchor, or linearly; none: the nearer one is shown alone; plateau: learned, and each "
             "anchor is whole until it begins to fade.",
     .models = kOfRelay,
     .stored_of = kOfRelay,
     .maximum = 3,
     .choices = "learned,linear,none,plateau"},
    {.name = "growth_by_level",
     .kind = FitOptionKind::kSwitch,
     .member = member<&FitOptions::growth_by_level>(),
     .help = "Anchors of a relay grow late where their features are varied.",
     .models = kOfRelay,
     .stored_of = kOfRelay,
     .maximum = 1},
    {.name = "middle_level_rank",
     .kind = FitOptionKind::kNumber,
     .member = member<&FitOptions::middle_level_rank>(),
     .help = "Anchors of a relay whose features are more varied than those of this share of them "
             "are of the middle level.",
     .models = kOfRelay,
     .stored_of = kOfRelay,
     .maximum = 1},
    {.name = "high_level_rank",
     .kind = FitOptionKind::kNumber,
     .member = member<&FitOptions::high_level_rank>(),
     .help = "Anchors of a relay whose features are more varied than those of this share of them "
             "are of the high level.",
     .models = kOfRelay,
     .stored_of = kOfRelay,
     .maximum = 1},
    {.name = "middle_level_weight",
     .kind = FitOptionKind::kNumber,
     .member = member<&FitOptions::middle_level_weight>(),
     .help =
         "Growth begins with this weight of gradients where the level is middle; 1: as anywhere.",
     .models = kOfRelay,
     .stored_of = kOfRelay,
     .maximum = 1},
    {.name = "high_level_weight",
     .kind = FitOptionKind::kNumber,
     .member = member<&FitOptions::high_level_weight>(),
     .help = "Growth begins with this weight of gradients where the level is high; 1: as anywhere.",
     .models = kOfRelay,
     .stored_of = kOfRelay,
     .maximum = 1},
    {.name = "iterations",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::iterations>(),
     .help = "The fit takes this number of steps, each on one view; schedules scale with it.",
     .minimum = 1,
     .maximum = kMaxFitIterations,
     .presets = {{"500", "2000", "4000"},
                 {"500", "2000", "4000"},
                 {"1000", "4000", "15000"},
                 {"1000", "4000", "10000"},
                 {"6000", "15000", "30000"}}},
    {.name = "background",
     .kind = FitOptionKind::kChoice,
     .member = member<&FitOptions::background>(),
     .help = "This stands behind transparent images; random: another colour in every step.",
     .maximum = 2,
     .choices = "black,white,random"},
    {.name = "holdout",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::holdout>(),
     .help = "One view of this number, by name, is measured and not learned from; 0: none. A split "
             "that the data set names wins.",
     .maximum = kMax32},
    {.name = "seed",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::seed>(),
     .help = "Another seed gives other random numbers, and a fit that differs a little."},
    {.name = "ssim_share",
     .kind = FitOptionKind::kNumber,
     .member = member<&FitOptions::ssim_share>(),
     .help = "SSIM has this share of the loss; L1 has the rest.",
     .maximum = 1},
    {.name = "coarse_to_fine",
     .kind = FitOptionKind::kSwitch,
     .member = member<&FitOptions::coarse_to_fine>(),
     .help = "The first steps look at large images with a quarter and half of their width, which "
             "takes a fraction of the time.",
     .models = kOfExplicit,
     .stored_of = kOfExplicit,
     .maximum = 1,
     .presets = {{"1", "1", "1"}}},
    {.name = "measure_interval",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::measure_interval>(),
     .help = "The result is measured after every so many steps; 0: after a twentieth of the fit, "
             "at least 100."},
    {.name = "image_bytes",
     .kind = FitOptionKind::kBytes,
     .member = member<&FitOptions::picture_bytes>(),
     .help = "Images up to this size stay in memory; others are read again whenever they are "
             "wanted.",
     .stored_of = kOfNoModel,
     // Moving splats take 1.6 times the memory of others, and a series has more images than either
     // limit: 150,000 of them beside 24 cameras' images stay below 2 GiB so.
     .presets = {{}, {}, {"768MiB", "768MiB", "768MiB"}, {}, {"768MiB", "768MiB", "768MiB"}},
     .aliases = {{"image_memory", kMebibyte}, {"picture_bytes"}, {"picture_memory", kMebibyte}}},
    {.name = "max_bytes",
     .kind = FitOptionKind::kBytes,
     .member = member<&FitOptions::max_bytes>(),
     .help = "The whole fit takes about this memory at most: fewer splats and images are kept; 0: "
             "no limit.",
     .stored_of = kOfNoModel,
     .aliases = {{"memory", kMebibyte}}},
    {.name = "checkpoint_path",
     .kind = FitOptionKind::kText,
     .member = member<&FitOptions::checkpoint_path>(),
     .help = "This file keeps what a fit needs to go on; empty: none is written.",
     .stored_of = kOfNoModel},
    {.name = "checkpoint_interval",
     .kind = FitOptionKind::kCount,
     .member = member<&FitOptions::checkpoint_interval>(),
     .help = "A checkpoint is saved after every so many steps; 0: by time alone.",
     .stored_of = kOfNoModel,
     .aliases = {{"checkpoint_every"}}},
    {.name = "checkpoint_seconds",
     .kind = FitOptionKind::kNumber,
     .member = member<&FitOptions::checkpoint_seconds>(),
     .help = "A checkpoint is saved after so many seconds; 0: by steps alone.",
     .stored_of = kOfNoModel},
    {.name = "resume",
     .kind = FitOptionKind::kSwitch,
     .member = member<&FitOptions::resume>(),
     .help = "The fit goes on from its checkpoint, which must be of the same views and options.",
     .stored_of = kOfNoModel,
     .maximum = 1},
};

}  // namespace

std::span<const FitOption> fitOptionTable() {
  return kTable;
}

const FitOption* findFitOption(std::string_view name, double* unit) {
  if (name.starts_with("--")) name.remove_prefix(2);
  const auto is = [name](std::string_view wanted) {
    if (name.size() != wanted.size()) return false;
    for (size_t i = 0; i < name.size(); ++i) {
      if ((name[i] == '-' ? '_' : name[i]) != wanted[i]) return false;
    }
    return true;
  };
  for (const FitOption& option : kTable) {
    double found = is(option.name) ? 1 : 0;
    for (const FitOptionAlias& alias : option.aliases) {
      if (*alias.name && is(alias.name)) found = alias.unit;
    }
    if (found == 0) continue;
    if (unit) *unit = found;
    return &option;
  }
  return nullptr;
}

const char* fitQualityNames() {
  return "fast,balanced,fine";
}

}  // namespace stipple
