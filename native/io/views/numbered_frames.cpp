#include "io/views/numbered_frames.h"

#include <algorithm>
#include <functional>
#include <system_error>

#include "base/error.h"
#include "io/bytes/input_file.h"

namespace stipple {

namespace {

namespace fs = std::filesystem;

constexpr size_t kMostDigits = 9;

bool hasExtension(const fs::path& path, std::initializer_list<const char*> extensions) {
  const std::string extension = lowerExtension(path.string());
  return std::any_of(extensions.begin(), extensions.end(),
                     [&](const char* each) { return extension == each; });
}

bool isImageName(const fs::path& path) {
  return hasExtension(path, {".png", ".jpg", ".jpeg", ".exr", ".tif", ".tiff", ".webp"});
}

/// Where the number at the end of a stem begins; its end where there is none.
size_t numberBegin(const std::string& stem) {
  size_t begin = stem.size();
  while (begin > 0 && stem[begin - 1] >= '0' && stem[begin - 1] <= '9') --begin;
  return begin;
}

std::string beforeNumber(const fs::path& file_name) {
  const std::string stem = file_name.stem().string();
  return stem.substr(0, numberBegin(stem));
}

/// What a folder holds and the test passes, by name.
std::vector<fs::path> listed(const fs::path& folder,
                             const std::function<bool(const fs::directory_entry&)>& wanted) {
  std::vector<fs::path> found;
  std::error_code error;
  if (!fs::is_directory(folder, error)) return found;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (wanted(*entry)) found.push_back(entry->path());
  }
  if (error) {
    fail(ErrorCode::kIo, folder.string() + " cannot be listed: " + error.message());
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

std::optional<uint64_t> frameNumber(const fs::path& file_name) {
  const std::string stem = file_name.stem().string();
  size_t begin = numberBegin(stem);
  if (begin == stem.size()) return std::nullopt;
  while (begin + 1 < stem.size() && stem[begin] == '0') ++begin;
  if (stem.size() - begin > kMostDigits) return std::nullopt;
  return std::stoull(stem.substr(begin));
}

std::vector<NumberedFrame> numberedFrames(const fs::path& folder, const fs::path& like) {
  const std::string before = beforeNumber(like), extension = lowerExtension(like.string());
  std::vector<NumberedFrame> frames;
  const auto is_image = [](const fs::directory_entry& entry) {
    std::error_code ignored;
    return isImageName(entry.path()) && entry.is_regular_file(ignored);
  };
  for (const fs::path& path : listed(folder, is_image)) {
    const std::optional<uint64_t> number = frameNumber(path.filename());
    if (!number) continue;
    const bool is_like =
        like.empty() || (beforeNumber(path.filename()) == before &&
                         (!isImageName(like) || lowerExtension(path.string()) == extension));
    if (is_like) frames.push_back({*number, path.filename().string()});
  }
  std::stable_sort(frames.begin(), frames.end(),
                   [](const auto& a, const auto& b) { return a.number < b.number; });
  for (size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].number != frames[i - 1].number) continue;
    fail(ErrorCode::kFormat, folder.string() + " holds two images of frame " +
                                 std::to_string(frames[i].number) + ", " + frames[i - 1].file_name +
                                 " and " + frames[i].file_name +
                                 "; each frame of a camera has one");
  }
  return frames;
}

std::vector<fs::path> foldersIn(const fs::path& folder) {
  return listed(folder, [](const fs::directory_entry& entry) {
    std::error_code ignored;
    return entry.is_directory(ignored) && entry.path().filename().string().front() != '.';
  });
}

std::vector<fs::path> videosIn(const fs::path& folder) {
  return listed(folder, [](const fs::directory_entry& entry) {
    return hasExtension(entry.path(), {".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v"});
  });
}

}  // namespace stipple
