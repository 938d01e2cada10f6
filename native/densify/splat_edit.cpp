#include "densify/splat_edit.h"

#include <algorithm>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kRowGrain = 4096;
constexpr const char* kArrayNames[] = {"positions", "rotations", "log_scales", "logits", "sh"};

void requireCount(size_t seen, size_t needed, const std::string& what) {
  if (seen != needed) {
    fail(ErrorCode::kInvalidArgument, what + " holds " + std::to_string(seen) + " values; " +
                                          std::to_string(needed) + " are needed");
  }
}

void requireRows(const std::vector<uint32_t>& rows, size_t count, const std::string& what) {
  for (const uint32_t row : rows) {
    if (row >= count) {
      fail(ErrorCode::kInvalidArgument,
           what + " names splat " + std::to_string(row) + "; there are " + std::to_string(count));
    }
  }
}

void requireOnce(std::vector<uint32_t> rows, const std::string& what) {
  std::sort(rows.begin(), rows.end());
  const auto twice = std::adjacent_find(rows.begin(), rows.end());
  if (twice != rows.end()) {
    fail(ErrorCode::kInvalidArgument,
         what + " names splat " + std::to_string(*twice) + " twice; once is allowed");
  }
}

void validateAppended(const RawSplats& append, const RawSplats& splats) {
  if (append.size() > 0 && append.sh_degree != splats.sh_degree) {
    fail(ErrorCode::kInvalidArgument, "append has harmonics of degree " +
                                          std::to_string(append.sh_degree) + "; the splats have " +
                                          std::to_string(splats.sh_degree));
  }
  for (size_t i = 0; i < kRawArrayCount; ++i) {
    const RawArray array = static_cast<RawArray>(i);
    const std::string name = std::string("append.") + kArrayNames[i];
    const size_t length = rowLength(append, array);
    requireCount(arrayOf(append, array).size(), append.size() * length, name);
    requireFinite(arrayOf(append, array).data(), append.size() * length, length, name.c_str());
  }
}

void gatherRows(const std::vector<uint32_t>& rows, size_t length, std::vector<float>& values) {
  std::vector<float> kept(rows.size() * length);
  parallelFor(rows.size(), kRowGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::copy_n(values.data() + rows[i] * length, length, kept.data() + i * length);
    }
  });
  values.swap(kept);
}

}  // namespace

void validate(const SplatEdit& edit, const RawSplats& splats) {
  for (size_t i = 0; i < edit.writes.size(); ++i) {
    const RowWrite& write = edit.writes[i];
    const std::string name = "write " + std::to_string(i);
    if (static_cast<size_t>(write.array) >= kRawArrayCount) {
      fail(ErrorCode::kInvalidArgument, name + " is of array " +
                                            std::to_string(static_cast<uint32_t>(write.array)) +
                                            "; 0 to 4 is allowed");
    }
    const size_t length = rowLength(splats, write.array);
    requireRows(write.rows, splats.size(), name);
    requireOnce(write.rows, name);
    requireCount(write.values.size(), write.rows.size() * length, name);
    requireFinite(write.values.data(), write.values.size(), length, (name + ": row").c_str());
  }
  if (edit.keep) requireRows(*edit.keep, splats.size(), "keep");
  validateAppended(edit.append, splats);
  const size_t count = (edit.keep ? edit.keep->size() : splats.size()) + edit.append.size();
  if (count > std::numeric_limits<uint32_t>::max()) {
    fail(ErrorCode::kUnsupported, "the edit makes " + std::to_string(count) +
                                      " splats; at most 4294967295 can be drawn together");
  }
}

void applyEdit(const SplatEdit& edit, bool moments, RawSplats& splats) {
  for (const RowWrite& write : edit.writes) {
    if (moments && !write.clear_moments) continue;
    const size_t length = rowLength(splats, write.array);
    float* values = arrayOf(splats, write.array).data();
    for (size_t i = 0; i < write.rows.size(); ++i) {
      float* row = values + write.rows[i] * length;
      if (moments) {
        std::fill_n(row, length, 0.0f);
      } else {
        std::copy_n(&write.values[i * length], length, row);
      }
    }
  }
  for (size_t i = 0; i < kRawArrayCount; ++i) {
    const RawArray array = static_cast<RawArray>(i);
    std::vector<float>& values = arrayOf(splats, array);
    const size_t length = rowLength(splats, array);
    if (edit.keep) gatherRows(*edit.keep, length, values);
    const std::vector<float>& added = arrayOf(edit.append, array);
    if (moments) {
      values.resize(values.size() + added.size(), 0.0f);
    } else {
      values.insert(values.end(), added.begin(), added.end());
    }
  }
}

}  // namespace stipple
