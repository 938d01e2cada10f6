#include "densify/strategies.h"

#include "base/error.h"
#include "densify/adaptive.h"

namespace stipple {

namespace {

struct Entry {
  const char* name;
  std::unique_ptr<Strategy> (*make)();
};

constexpr Entry kEntries[] = {
    {"adaptive", [] { return makeAdaptive(); }},
};

std::vector<std::string> allNames() {
  std::vector<std::string> names;
  for (const Entry& entry : kEntries) names.emplace_back(entry.name);
  return names;
}

}  // namespace

const std::vector<std::string>& strategyNames() {
  static const std::vector<std::string> names = allNames();
  return names;
}

std::unique_ptr<Strategy> makeStrategy(const std::string& name) {
  for (const Entry& entry : kEntries) {
    if (name == entry.name) return entry.make();
  }
  std::string known;
  for (const std::string& each : strategyNames()) known += (known.empty() ? "" : ", ") + each;
  fail(ErrorCode::kInvalidArgument, "strategy is '" + name + "'; there is " + known);
}

}  // namespace stipple
