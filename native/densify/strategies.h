#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "densify/control_part.h"

namespace stipple {

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

 private:
  std::string owner_;
  std::map<std::string, double> values_;
  std::vector<std::string> known_;
};

/// A strategy, or a part that goes into one, as users see it.
struct StrategyEntry {
  const char* name;
  const char* summary;  ///< one sentence for artists
};

/// In the order in which they are shown.
const std::vector<StrategyEntry>& strategyEntries();
const std::vector<StrategyEntry>& partEntries();
/// Of fields (train/loop/field_model.h), whose density decides where splats are; makeStrategy() makes
/// none of them.
const std::vector<StrategyEntry>& fieldStrategyEntries();
const std::vector<std::string>& strategyNames();

/// A strategy with the settings of its publication, and parts beside or instead of its own:
/// "adaptive", "adaptive+long_axis_split+growth_control", "improved(threshold=0.0002)". A part
/// takes the place of the strategy's own that decides the same. Errors: kInvalidArgument for a
/// strategy, part or setting that is not there (the message says which are), a strategy of fields,
/// a part that is named twice, and one that does not go with another (says which, and what both
/// decide).
std::unique_ptr<Strategy> makeStrategy(const std::string& text);

}  // namespace stipple
