#include "base/nearest_name.h"

#include <algorithm>
#include <numeric>
#include <vector>

namespace stipple {

size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);  // distances of the begin of `a` to all begins of `b`
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i + 1;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

std::string nearestName(std::string_view name, std::span<const std::string> known) {
  std::string nearest;
  size_t least = name.size();
  for (const std::string& candidate : known) {
    const size_t distance = editDistance(name, candidate);
    if (distance >= least || 2 * distance > std::max(name.size(), candidate.size())) continue;
    least = distance;
    nearest = candidate;
  }
  return nearest;
}

}  // namespace stipple
