#include "io/bytes/temporary_files.h"

#include <charconv>
#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <system_error>

#include "base/platform/files.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr char kPrefix[] = ".stipple-";
constexpr auto kSweepInterval = std::chrono::minutes(1);

/// The process in a name that temporaryFileName() has made; nothing for other names.
std::optional<long> processOf(const std::string& name) {
  const size_t start = sizeof(kPrefix) - 1;
  if (name.compare(0, start, kPrefix) != 0) return std::nullopt;
  const char* const end = name.data() + name.size();
  long process = 0;
  unsigned number = 0;
  const auto first = std::from_chars(name.data() + start, end, process);
  if (first.ec != std::errc() || process <= 0 || first.ptr == end || *first.ptr != '-') {
    return std::nullopt;
  }
  const auto second = std::from_chars(first.ptr + 1, end, number);
  if (second.ec != std::errc() || (second.ptr != end && *second.ptr != '.')) return std::nullopt;
  return process;
}

/// Whether this process has not looked at the folder lately.
bool isDue(const fs::path& folder) {
  static std::mutex mutex;
  // Never destroyed: a job may still write when a process ends.
  static auto& seen = *new std::map<fs::path, Clock::time_point>;
  const Clock::time_point now = Clock::now();
  std::lock_guard<std::mutex> lock(mutex);
  const auto [place, is_new] = seen.emplace(folder, now);
  if (!is_new && now - place->second < kSweepInterval) return false;
  place->second = now;
  return true;
}

}  // namespace

std::string temporaryFileName(long process, unsigned number) {
  return kPrefix + std::to_string(process) + "-" + std::to_string(number);
}

void sweepTemporaryFiles(const fs::path& folder) {
  std::error_code error;
  const fs::path absolute = fs::absolute(folder.empty() ? fs::path(".") : folder, error);
  if (error || !isDue(absolute)) return;
  fs::directory_iterator entry(absolute, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const std::optional<long> process = processOf(entry->path().filename().string());
    if (process && !platform::mayLive(*process)) platform::removeUnlocked(entry->path().string());
  }
}

}  // namespace stipple
