#include "io/views/colmap_reading.h"

namespace stipple {

namespace {

constexpr size_t kChunkBytes = size_t{1} << 20;
constexpr size_t kMaxLineBytes = size_t{1} << 30;

}  // namespace

bool ColmapLines::next(bool content) {
  for (;;) {
    size_t end = window_.find('\n', position_);
    while (end == std::string::npos && read_ < file_.size()) {
      window_.erase(0, position_);
      position_ = 0;
      const size_t kept = window_.size();
      if (kept > kMaxLineBytes) failHere("is followed by a line of more than 1 GiB");
      const size_t more =
          static_cast<size_t>(std::min<uint64_t>(file_.size() - read_, kChunkBytes));
      window_.resize(kept + more);
      file_.readAt(read_, window_.data() + kept, more);
      read_ += more;
      end = window_.find('\n', kept);
    }
    if (end == std::string::npos && position_ >= window_.size()) return false;
    line_ = std::string_view(window_).substr(position_, end - position_);
    position_ = end == std::string::npos ? window_.size() : end + 1;
    ++number_;
    while (!line_.empty() && (line_.back() == '\r' || line_.back() == ' ')) line_.remove_suffix(1);
    skipSpaces();
    if (!content || (!line_.empty() && line_.front() != '#')) return true;
  }
}

std::string_view ColmapLines::word() {
  const size_t end = std::min(line_.find_first_of(" \t"), line_.size());
  const std::string_view word = line_.substr(0, end);
  line_.remove_prefix(end);
  skipSpaces();
  return word;
}

void ColmapLines::failHere(const std::string& what) const {
  fail(ErrorCode::kFormat, file_.path() + ": line " + std::to_string(number_) + " " + what);
}

}  // namespace stipple
