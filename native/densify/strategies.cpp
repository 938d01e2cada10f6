#include "densify/strategies.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/number_reading.h"

namespace stipple {

namespace {

std::string listOf(const std::vector<StrategyEntry>& entries) {
  std::string text;
  for (const StrategyEntry& entry : entries)
    text += (text.empty() ? "" : ", ") + std::string(entry.name);
  return text.empty() ? "none" : text;
}

/// "name(key=1,other=2)".
struct Term {
  std::string name;
  std::map<std::string, double> values;
};

[[noreturn]] void failTerm(const std::string& term) {
  fail(ErrorCode::kInvalidArgument,
       "strategy has '" + term + "'; name or name(setting=number,...) is allowed");
}

Term parseTerm(const std::string& text) {
  Term term;
  const size_t open = text.find('(');
  term.name = text.substr(0, open);
  if (open == std::string::npos) return term;
  if (text.back() != ')') failTerm(text);
  std::string inner = text.substr(open + 1, text.size() - open - 2);
  for (size_t begin = 0; begin < inner.size();) {
    const size_t end = std::min(inner.find(',', begin), inner.size());
    const std::string pair = inner.substr(begin, end - begin);
    const size_t equals = pair.find('=');
    double value = 0;
    if (equals == std::string::npos || equals == 0) failTerm(text);
    const char* last = pair.data() + pair.size();
    const auto read = readNumber(pair.data() + equals + 1, last, value);
    if (read.ec != std::errc{} || read.ptr != last || !std::isfinite(value)) failTerm(text);
    term.values[pair.substr(0, equals)] = value;
    begin = end + 1;
  }
  return term;
}

/// The entry of a name, or null.
const StrategyEntry* entryOf(const std::string& name, const std::vector<StrategyEntry>& entries) {
  const auto found = std::find_if(entries.begin(), entries.end(),
                                  [&](const StrategyEntry& entry) { return name == entry.name; });
  return found == entries.end() ? nullptr : &*found;
}

/// An entry with the settings of a term. Errors: kInvalidArgument for one that it does not have.
ControlAssembly madeOf(const StrategyEntry& entry, const Term& term) {
  StrategySettings settings(term.name, term.values);
  ControlAssembly assembly = entry.make(settings);
  settings.requireAllUsed();
  return assembly;
}

std::vector<Term> parse(const std::string& text) {
  std::vector<Term> terms;
  size_t begin = 0;
  int depth = 0;
  for (size_t k = 0; k <= text.size(); ++k) {
    // A plus inside parentheses belongs to a number.
    if (k < text.size() && text[k] == '(') ++depth;
    if (k < text.size() && text[k] == ')') --depth;
    if (k < text.size() && (text[k] != '+' || depth > 0)) continue;
    terms.push_back(parseTerm(text.substr(begin, k - begin)));
    begin = k + 1;
  }
  return terms;
}

EntryFacts madeFacts(const StrategyEntry& entry) {
  EntryFacts facts;
  const ControlRoles owned = rolesOf(entry);
  for (uint32_t bit = 0; bit < kControlRoleCount; ++bit) {
    const ControlRole role = static_cast<ControlRole>(1u << bit);
    if ((owned & roles(role)) == 0) continue;
    facts.decides += (facts.decides.empty() ? "" : ", ") + std::string(wordsOf(role));
  }
  facts.settings = settingsOf(entry);
  return facts;
}

}  // namespace

StrategySettings::StrategySettings(std::string owner, std::map<std::string, double> values)
    : owner_(std::move(owner)), values_(std::move(values)) {}

double StrategySettings::read(const StrategySetting& setting) {
  known_.push_back(setting);
  const auto found = values_.find(setting.name);
  if (found == values_.end()) return setting.otherwise;
  if (!(found->second >= setting.least && found->second <= setting.most)) {
    fail(ErrorCode::kInvalidArgument,
         owner_ + "." + setting.name + " is " + std::to_string(found->second) + "; " +
             std::to_string(setting.least) + " to " + std::to_string(setting.most) + " is allowed");
  }
  return found->second;
}

double StrategySettings::number(const std::string& name, double otherwise, double least,
                                double most) {
  return read({name, otherwise, least, most, false});
}

uint64_t StrategySettings::count(const std::string& name, uint64_t otherwise, uint64_t most) {
  return static_cast<uint64_t>(
      read({name, static_cast<double>(otherwise), 0, static_cast<double>(most), true}));
}

bool StrategySettings::flag(const std::string& name, bool otherwise) {
  return read({name, otherwise ? 1.0 : 0.0, 0, 1, true}) != 0;
}

void StrategySettings::requireAllUsed() const {
  for (const auto& [name, value] : values_) {
    std::string known;
    bool is_known = false;
    for (const StrategySetting& each : known_) {
      is_known = is_known || each.name == name;
      known += (known.empty() ? "" : ", ") + each.name;
    }
    if (is_known) continue;
    fail(ErrorCode::kInvalidArgument,
         owner_ + " has no setting '" + name + "'; there is " + (known.empty() ? "none" : known));
  }
}

const std::vector<std::string>& strategyNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const StrategyEntry& entry : strategyEntries()) all.emplace_back(entry.name);
    return all;
  }();
  return names;
}

std::vector<StrategySetting> settingsOf(const StrategyEntry& entry) {
  if (entry.make == nullptr) return {};
  StrategySettings settings(entry.name, {});
  entry.make(settings);
  return settings.known();
}

ControlRoles rolesOf(const StrategyEntry& entry) {
  if (entry.make == nullptr) return 0;
  StrategySettings settings(entry.name, {});
  ControlRoles owned = 0;
  for (const auto& part : entry.make(settings).parts) owned |= part->owns();
  return owned;
}

const EntryFacts* findFacts(const std::string& name) {
  static const std::map<std::string, EntryFacts> kFacts = [] {
    std::map<std::string, EntryFacts> all;
    for (const auto* entries : {&strategyEntries(), &partEntries(), &fieldStrategyEntries()}) {
      for (const StrategyEntry& each : *entries) all[each.name] = madeFacts(each);
    }
    return all;
  }();
  const auto found = kFacts.find(name);
  return found == kFacts.end() ? nullptr : &found->second;
}

std::unique_ptr<Strategy> makeStrategy(const std::string& text) {
  const std::vector<Term> terms = parse(text);
  if (entryOf(terms[0].name, fieldStrategyEntries()) != nullptr) {
    fail(ErrorCode::kInvalidArgument, terms[0].name +
                                          " moves the density of a field, which explicit splats "
                                          "do not have; there is " +
                                          listOf(strategyEntries()));
  }
  const StrategyEntry* strategy = entryOf(terms[0].name, strategyEntries());
  if (strategy == nullptr) {
    fail(ErrorCode::kInvalidArgument,
         "strategy is '" + terms[0].name + "'; there is " + listOf(strategyEntries()));
  }
  ControlAssembly assembly = madeOf(*strategy, terms[0]);

  std::vector<const ControlPart*> added;
  for (size_t k = 1; k < terms.size(); ++k) {
    const StrategyEntry* entry = entryOf(terms[k].name, partEntries());
    if (entry == nullptr) {
      fail(ErrorCode::kInvalidArgument,
           "part is '" + terms[k].name + "'; there is " + listOf(partEntries()));
    }
    for (size_t before = 1; before < k; ++before) {
      if (terms[before].name == terms[k].name) {
        fail(ErrorCode::kInvalidArgument,
             "strategy names " + terms[k].name + " twice; once is allowed");
      }
    }
    for (std::unique_ptr<ControlPart>& part : madeOf(*entry, terms[k]).parts) {
      for (const ControlPart* before : added) requireApart(*part, *before);
      added.push_back(part.get());
      addPart(assembly, std::move(part));
    }
  }
  return makeDensityControl(text.c_str(), std::move(assembly));
}

}  // namespace stipple
