#include "train/optimiser/sparse_adam.h"

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;

/// Rows of kLength numbers, or of `length` where that is 0: short copies of a known size need no
/// calls.
template <size_t kLength>
void gatherRows(const SparseRows& table, size_t begin, size_t end, const float* from, float* to) {
  const size_t length = kLength == 0 ? table.row_length : kLength;
  for (size_t i = begin; i < end; ++i) {
    for (size_t k = 0; k < length; ++k) to[i * length + k] = from[table.rows[i] * length + k];
  }
}

template <size_t kLength>
void scatterRows(const SparseRows& table, size_t begin, size_t end, const float* from, float* to) {
  const size_t length = kLength == 0 ? table.row_length : kLength;
  for (size_t i = begin; i < end; ++i) {
    for (size_t k = 0; k < length; ++k) to[table.rows[i] * length + k] = from[i * length + k];
  }
}

void gather(const SparseRows& table, const float* from, float* to) {
  parallelFor(table.rows.size(), kGrain, [&](size_t begin, size_t end) {
    switch (table.row_length) {
      case 3:
        return gatherRows<3>(table, begin, end, from, to);
      case 8:
        return gatherRows<8>(table, begin, end, from, to);
      default:
        return gatherRows<0>(table, begin, end, from, to);
    }
  });
}

void scatter(const SparseRows& table, const float* from, float* to) {
  parallelFor(table.rows.size(), kGrain, [&](size_t begin, size_t end) {
    switch (table.row_length) {
      case 3:
        return scatterRows<3>(table, begin, end, from, to);
      case 8:
        return scatterRows<8>(table, begin, end, from, to);
      default:
        return scatterRows<0>(table, begin, end, from, to);
    }
  });
}

}  // namespace

void sparseAdamStep(std::span<const SparseRows> tables, uint64_t step, const AdamOptions& options,
                    SparseAdamScratch& scratch) {
  size_t count = 0;
  for (const SparseRows& table : tables) count += table.rows.size() * table.row_length;
  for (std::vector<float>* values :
       {&scratch.parameters, &scratch.gradients, &scratch.first_moments, &scratch.second_moments}) {
    values->resize(count);
  }
  std::vector<AdamGroup> groups;
  size_t at = 0;
  for (const SparseRows& table : tables) {
    gather(table, table.parameters, &scratch.parameters[at]);
    gather(table, table.gradients, &scratch.gradients[at]);
    gather(table, table.first_moments, &scratch.first_moments[at]);
    gather(table, table.second_moments, &scratch.second_moments[at]);
    groups.push_back({&scratch.parameters[at], &scratch.gradients[at], &scratch.first_moments[at],
                      &scratch.second_moments[at], table.rows.size(), table.row_length,
                      table.learning_rate});
    at += table.rows.size() * table.row_length;
  }
  adamStep(groups, step, options);
  at = 0;
  for (const SparseRows& table : tables) {
    scatter(table, &scratch.parameters[at], table.parameters);
    scatter(table, &scratch.first_moments[at], table.first_moments);
    scatter(table, &scratch.second_moments[at], table.second_moments);
    at += table.rows.size() * table.row_length;
  }
}

}  // namespace stipple
