#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "fit/fit_options.h"

namespace stipple {

enum class FitOptionKind : uint32_t {
  kCount = 0,   ///< a whole number
  kNumber = 1,  ///< any number
  kBytes = 2,   ///< a whole number; texts may end in KiB, MiB or GiB
  kSwitch = 3,  ///< 0 or 1
  kChoice = 4,  ///< the place of a word in a list
  kText = 5,
};

/// Switches, choices, counts and bytes are whole numbers.
using FitValue = std::variant<uint64_t, double, std::string>;

/// Bits of a set of models.
constexpr uint32_t kOfExplicit = 1u << static_cast<uint32_t>(FitKind::kExplicit);
constexpr uint32_t kOfField = 1u << static_cast<uint32_t>(FitKind::kField);
constexpr uint32_t kOfMotion = 1u << static_cast<uint32_t>(FitKind::kMotion);
constexpr uint32_t kOfScaffold = 1u << static_cast<uint32_t>(FitKind::kScaffold);
constexpr uint32_t kOfRelay = 1u << static_cast<uint32_t>(FitKind::kRelay);
/// Whose anchors have features.
constexpr uint32_t kOfScaffolds = kOfScaffold | kOfRelay;
/// Whose anchors become splats.
constexpr uint32_t kOfAnchors = kOfField | kOfScaffolds;
/// Whose splats have parameters of their own.
constexpr uint32_t kOfSplats = kOfExplicit | kOfMotion;
constexpr uint32_t kOfEveryModel = kOfSplats | kOfAnchors;
constexpr uint32_t kOfNoModel = 0;

/// How an option lies in FitOptions.
struct FitMember {
  FitValue (*get)(const FitOptions&) = nullptr;
  void (*set)(FitOptions&, const FitValue&) = nullptr;
};

constexpr size_t kFitAliasCount = 3;

/// Another name of an option: a former one, or one that counts in another unit.
struct FitOptionAlias {
  const char* name = "";  ///< empty: there is none
  double unit = 1;        ///< how much 1 is under this name
};

/// An option of a fit: the one place that says what it is. Checks, presets, the settings of
/// checkpoints and reports, what a resumed fit must share, the flags and help of the tool and
/// stipple_fit_option_info are made from it.
struct FitOption {
  /// In StippleFitOptions and in settings; the tool has it with - for _.
  const char* name;
  FitOptionKind kind;
  FitMember member;
  const char* help;                 ///< one sentence
  uint32_t models = kOfEveryModel;  ///< bits: whom it concerns; others ignore it
  /// Bits: in whose settings it stands. A fit that goes on needs it as it was there; elsewhere it
  /// may change.
  uint32_t stored_of = kOfEveryModel;
  double minimum = 0;
  double maximum = std::numeric_limits<double>::infinity();
  /// Another count that this one may not exceed, where there is one.
  uint64_t FitOptions::*not_above = nullptr;
  const char* choices = "";  ///< of a choice: its words, with commas between
  /// Of a choice: settings have its word, where others have its number.
  bool is_stored_as_word = false;
  /// As texts; null: the preset leaves it as it is.
  const char* presets[kFitKindCount][kFitQualityCount] = {};
  /// Settings keep this name, where it is not that of the option: checkpoints compare settings as
  /// texts.
  const char* stored_name = "";
  /// Names that settings and flags may also use, first those of today.
  FitOptionAlias aliases[kFitAliasCount] = {};
};

/// All options, in the order in which settings have them.
std::span<const FitOption> fitOptionTable();

/// The option of this name, or null. Accepts other names of options, - for _, and -- in front, as
/// flags have them. Out: unit: how much 1 is under the name.
const FitOption* findFitOption(std::string_view name, double* unit = nullptr);

/// "fast, balanced, fine" and so on: in what presets are chosen.
const char* fitQualityNames();

/// The value as a user writes it: a word of a choice, "1GiB", 0.2.
std::string fitValueText(const FitOption& option, const FitValue& value);

/// The default of the option in this row of the table, as a user writes it; it lasts as long as the
/// library.
const char* defaultFitText(size_t index);

/// What requireFitOptions() allows, for a message or a help: "1 to 10000000".
std::string fitRangeText(const FitOption& option);

/// Reads a value as a user writes it. In: name, of the option in messages; unit, of former names.
/// Errors: kInvalidArgument for what is no such value or out of range.
FitValue fitValueFrom(const FitOption& option, std::string_view text, const std::string& name,
                      double unit = 1);

/// Refuses a value out of the option's own range: "NAME is 0; 1 to 10000000 is allowed".
void requireInRange(const FitOption& option, const FitValue& value, const std::string& name);

}  // namespace stipple
