#include "nn/scratch.h"

#include <cstdint>
#include <mutex>
#include <utility>
#include <vector>

namespace stipple {

namespace {

constexpr size_t kLine = 64;

/// Memory that nobody uses. It lives as long as the process: a thread may give some back when
/// static objects are destroyed.
struct Store {
  std::mutex mutex;
  std::vector<DefaultInitVector<float>> idle;
  size_t floats = 0;

  static Store& instance() {
    static Store& store = *new Store;
    return store;
  }
};

}  // namespace

Scratch::Scratch(size_t count) {
  if (count == 0) return;
  count += kLine / sizeof(float);
  Store& store = Store::instance();
  {
    const std::lock_guard<std::mutex> lock(store.mutex);
    for (size_t i = 0; i < store.idle.size(); ++i) {
      // Not one that is far too large: what is large is wanted again by others.
      if (store.idle[i].size() < count || store.idle[i].size() / 4 > count) continue;
      std::swap(store.idle[i], store.idle.back());
      values_ = std::move(store.idle.back());
      store.idle.pop_back();
      store.floats -= values_.size();
      findLine();
      return;
    }
  }
  values_.resize(count);
  findLine();
}

void Scratch::findLine() {
  const auto address = reinterpret_cast<uintptr_t>(values_.data());
  line_ = values_.data() + (kLine - address % kLine) % kLine / sizeof(float);
}

Scratch::~Scratch() {
  Store& store = Store::instance();
  if (values_.empty()) return;
  const std::lock_guard<std::mutex> lock(store.mutex);
  if (store.floats + values_.size() > kMostIdle) return;
  store.floats += values_.size();
  store.idle.push_back(std::move(values_));
}

}  // namespace stipple
