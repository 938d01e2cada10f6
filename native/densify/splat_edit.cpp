#include "densify/splat_edit.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr const char* kArrayNames[] = {"positions", "rotations", "log_scales", "logits", "sh"};

std::string nameOf(RawArray array) {
  const size_t index = static_cast<size_t>(array);
  return index < kRawArrayCount ? kArrayNames[index]
                                : "extras[" + std::to_string(index - kRawArrayCount) + "]";
}

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

bool isRising(const std::vector<uint32_t>& rows) {
  return std::adjacent_find(rows.begin(), rows.end(), std::greater_equal<>()) == rows.end();
}

void requireOnce(const std::vector<uint32_t>& given, const std::string& what) {
  if (isRising(given)) return;
  std::vector<uint32_t> rows = given;
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
  if (append.size() > 0 && append.extra_lengths != splats.extra_lengths) {
    fail(ErrorCode::kInvalidArgument, "append has " + std::to_string(append.extra_lengths.size()) +
                                          " extra parameters; it must have the splats' " +
                                          std::to_string(splats.extra_lengths.size()) +
                                          ", of the same lengths");
  }
  requireCount(append.extras.size(), append.extra_lengths.size(), "append.extras");
  for (size_t i = 0; i < arrayCount(append); ++i) {
    const RawArray array = static_cast<RawArray>(i);
    const std::string name = "append." + nameOf(array);
    const size_t length = rowLength(append, array);
    requireCount(arrayOf(append, array).size(), append.size() * length, name);
    requireFinite(arrayOf(append, array).data(), append.size() * length, length, name.c_str());
  }
}

/// One array of one target.
struct ArrayEdit {
  const SplatEdit* edit;
  EditTarget target;
  RawArray array;
  bool keep_is_rising;
  std::vector<float> gathered;  ///< room for rows of a list that does not rise

  auto& values() const { return arrayOf(*target.splats, array); }
  size_t rowSize() const { return rowLength(*target.splats, array); }

  /// Takes all memory that run() needs.
  void reserve() {
    const size_t needed = edit->countAfter(target.splats->size()) * rowSize();
    if (needed > values().capacity()) values().reserve(needed + needed / 4);
    if (edit->keep && !keep_is_rising) gathered.reserve(edit->keep->size() * rowSize());
  }

  void run() {
    for (const RowWrite& write : edit->writes) {
      if (write.array == array && (!target.is_moments || write.clear_moments)) writeRows(write);
    }
    if (edit->keep) keepRows(*edit->keep);
    const size_t added = edit->append.size() * rowSize();
    if (target.is_moments) {
      values().resize(values().size() + added, 0.0f);
    } else if (added > 0) {
      const auto& rows = arrayOf(edit->append, array);
      values().insert(values().end(), rows.begin(), rows.end());
    }
  }

 private:
  void writeRows(const RowWrite& write) const {
    const size_t length = rowSize();
    for (size_t i = 0; i < write.rows.size(); ++i) {
      float* row = values().data() + write.rows[i] * length;
      if (target.is_moments) {
        std::fill_n(row, length, 0.0f);
      } else {
        std::copy_n(&write.values[i * length], length, row);
      }
    }
  }

  void keepRows(const std::vector<uint32_t>& keep) {
    const size_t length = rowSize();
    float* all = values().data();
    if (keep_is_rising) {
      // Rows only move down, behind those that have moved: no other memory is needed.
      for (size_t i = 0; i < keep.size(); ++i) {
        if (keep[i] != i) std::copy_n(all + keep[i] * length, length, all + i * length);
      }
    } else {
      for (const uint32_t row : keep) {
        gathered.insert(gathered.end(), all + row * length, all + (row + 1) * length);
      }
      values().assign(gathered.begin(), gathered.end());
    }
    values().resize(keep.size() * length);
  }
};

}  // namespace

void validate(const SplatEdit& edit, const RawSplats& splats) {
  for (size_t i = 0; i < edit.writes.size(); ++i) {
    const RowWrite& write = edit.writes[i];
    const std::string name = "write " + std::to_string(i);
    if (static_cast<size_t>(write.array) >= arrayCount(splats)) {
      fail(ErrorCode::kInvalidArgument,
           name + " is of array " + std::to_string(static_cast<uint32_t>(write.array)) + "; 0 to " +
               std::to_string(arrayCount(splats) - 1) + " is allowed");
    }
    const size_t length = rowLength(splats, write.array);
    requireRows(write.rows, splats.size(), name);
    requireOnce(write.rows, name);
    requireCount(write.values.size(), write.rows.size() * length, name);
    requireFinite(write.values.data(), write.values.size(), length, (name + ": row").c_str());
  }
  if (edit.keep) requireRows(*edit.keep, splats.size(), "keep");
  validateAppended(edit.append, splats);
  const size_t count = edit.countAfter(splats.size());
  if (count > std::numeric_limits<uint32_t>::max()) {
    fail(ErrorCode::kUnsupported, "the edit makes " + std::to_string(count) +
                                      " splats; at most 4294967295 can be drawn together");
  }
}

void applyEdit(const SplatEdit& edit, std::span<const EditTarget> targets) {
  std::vector<ArrayEdit> parts;
  const bool keep_is_rising = edit.keep && isRising(*edit.keep);
  for (const EditTarget& target : targets) {
    for (size_t i = 0; i < arrayCount(*target.splats); ++i) {
      parts.push_back({&edit, target, static_cast<RawArray>(i), keep_is_rising, {}});
    }
  }
  for (ArrayEdit& part : parts) part.reserve();
  // The largest arrays first, so that no thread begins one when the others are done.
  std::stable_sort(parts.begin(), parts.end(), [](const ArrayEdit& a, const ArrayEdit& b) {
    return a.rowSize() > b.rowSize();
  });
  parallelFor(parts.size(), 1, [&parts](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) parts[i].run();
  });
}

}  // namespace stipple
