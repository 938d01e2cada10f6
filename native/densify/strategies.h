#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "densify/control_part.h"

namespace stipple {

/// One number that users may set of a strategy or a part.
struct StrategySetting {
  std::string name;
  double otherwise = 0;  ///< what it is where nobody sets it
  double least = 0;
  double most = 0;
  bool is_whole = false;  ///< a count, or 0 and 1 for no and yes
};

/// Numbers that a user sets for a strategy or a part, read by name while it is made.
class StrategySettings {
 public:
  StrategySettings(std::string owner, std::map<std::string, double> values);

  /// Errors: kInvalidArgument where it is outside [least, most].
  double number(const std::string& name, double otherwise, double least, double most);
  uint64_t count(const std::string& name, uint64_t otherwise, uint64_t most = uint64_t{1} << 28);
  bool flag(const std::string& name, bool otherwise);

  /// Errors: kInvalidArgument for a name that was given and that nobody asked for; the message says
  /// which there are.
  void requireAllUsed() const;

  /// What was asked for, in that order.
  const std::vector<StrategySetting>& known() const { return known_; }

 private:
  double read(const StrategySetting& setting);

  std::string owner_;
  std::map<std::string, double> values_;
  std::vector<StrategySetting> known_;
};

constexpr uint32_t kNoPartBit = UINT32_MAX;

/// What users may name: a whole strategy, or a part that goes into one. Both are lists of parts
/// with a preset of their settings; the list of a part is one long. A row of the table in
/// strategy_table.cpp.
struct StrategyEntry {
  const char* name;     ///< "long_axis_split"
  const char* label;    ///< for people: "Long Axis Split"
  const char* summary;  ///< one sentence for artists
  /// Null for those of fields, which are no lists of parts.
  ControlAssembly (*make)(StrategySettings& settings) = nullptr;
  /// Of a part, 0..30: under which files keep that it was chosen, so it is never given to another
  /// one. Of a strategy: kNoPartBit.
  uint32_t bit = kNoPartBit;
};

/// In the order in which they are shown.
const std::vector<StrategyEntry>& strategyEntries();
const std::vector<StrategyEntry>& partEntries();
/// Of fields (train/loop/field_model.h), whose density decides where splats are; makeStrategy()
/// makes none of them.
const std::vector<StrategyEntry>& fieldStrategyEntries();
const std::vector<std::string>& strategyNames();

/// The numbers that users may set, told by making it.
std::vector<StrategySetting> settingsOf(const StrategyEntry& entry);
/// What it decides; 0 for those of fields.
ControlRoles rolesOf(const StrategyEntry& entry);

/// What is told of an entry beside its row, found by making it.
struct EntryFacts {
  std::string decides;  ///< words for its roles, with commas between
  std::vector<StrategySetting> settings;
};

/// The facts of the strategy or part of this name, or null; they last as long as the library.
const EntryFacts* findFacts(const std::string& name);

/// A strategy with the settings of its publication, and parts beside or instead of its own:
/// "adaptive", "adaptive+long_axis_split+growth_control", "improved(threshold=0.0002)". A part
/// takes the place of the strategy's own that decides the same. Errors: kInvalidArgument for a
/// strategy, part or setting that is not there (the message says which are), a strategy of fields,
/// a part that is named twice, and one that does not go with another (says which, and what both
/// decide).
std::unique_ptr<Strategy> makeStrategy(const std::string& text);

}  // namespace stipple
