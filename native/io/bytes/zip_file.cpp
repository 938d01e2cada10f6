// Based on: PKWARE, .ZIP File Format Specification (APPNOTE), version 6.3: local headers, central
// directory, end record.
#include "io/bytes/zip_file.h"

#include <algorithm>
#include <limits>
#include <string_view>

#include "base/error.h"
#include "io/media_library.h"

namespace stipple {

namespace {

constexpr uint32_t kEntrySignature = 0x04034b50;
constexpr uint32_t kDirectorySignature = 0x02014b50;
constexpr uint32_t kEndSignature = 0x06054b50;
constexpr size_t kEntryBytes = 30;
constexpr size_t kDirectoryBytes = 46;
constexpr size_t kEndBytes = 22;
constexpr size_t kMaxComment = 65535;
constexpr uint16_t kEncrypted = 1;
constexpr uint16_t kStored = 0;
constexpr uint16_t kDeflated = 8;
// Set where a number does not fit and a 64-bit record holds it.
constexpr uint32_t kIn64Bits = 0xffffffff;
// Deflate spends at least a bit on each run of 258 bytes.
constexpr uint64_t kMaxDeflateRatio = 1032;
// An extra field begins with its kind and its length; of this kind is padding, as of Pixar's USDZ.
constexpr uint64_t kExtraHead = 4;
constexpr uint32_t kPaddingField = 0x1986;
// 1 January 1980, the format's first day.
constexpr uint16_t kNoDate = 0x21;

uint32_t number(const std::vector<char>& bytes, size_t at, unsigned width) {
  uint32_t value = 0;
  for (unsigned b = 0; b < width; ++b) {
    value |= static_cast<uint32_t>(static_cast<unsigned char>(bytes[at + b])) << (8 * b);
  }
  return value;
}

void append(std::string& bytes, uint32_t value, unsigned width) {
  for (unsigned b = 0; b < width; ++b) bytes.push_back(static_cast<char>(value >> (8 * b)));
}

/// True for names that would lie outside a folder they are put in.
bool leavesFolder(std::string_view name) {
  if (name.empty() || name.front() == '/' || name.find('\\') != name.npos ||
      name.find(':') != name.npos || name.find('\0') != name.npos) {
    return true;
  }
  for (size_t start = 0; start <= name.size();) {
    const size_t end = std::min(name.find('/', start), name.size());
    if (name.substr(start, end - start) == "..") return true;
    start = end + 1;
  }
  return false;
}

/// A name as messages show it: short, in one line.
std::string shown(const std::string& name) {
  std::string text = name.substr(0, 100);
  for (char& letter : text) {
    if (static_cast<unsigned char>(letter) < 32 || letter == 127) letter = '?';
  }
  return text;
}

}  // namespace

ZipReader::ZipReader(const InputFile& file) : file_(file) {
  readDirectory();
}

void ZipReader::failHere(const std::string& what) const {
  fail(ErrorCode::kFormat, file_.path() + " " + what);
}

void ZipReader::readDirectory() {
  // The end record lies before a comment of unknown length.
  const uint64_t tail_bytes = std::min<uint64_t>(file_.size(), kEndBytes + kMaxComment);
  std::vector<char> tail(static_cast<size_t>(tail_bytes));
  file_.readAt(file_.size() - tail_bytes, tail.data(), tail.size());
  size_t end = tail.size();
  for (size_t at = tail.size() < kEndBytes ? 0 : tail.size() - kEndBytes + 1; at-- > 0;) {
    if (number(tail, at, 4) == kEndSignature &&
        at + kEndBytes + number(tail, at + 20, 2) == tail.size()) {
      end = at;
      break;
    }
  }
  if (end == tail.size()) {
    failHere("is not a whole zip archive: its " + std::to_string(file_.size()) +
             " bytes do not end with a directory");
  }
  const uint32_t count = number(tail, end + 10, 2);
  const uint32_t directory_bytes = number(tail, end + 12, 4);
  const uint32_t directory = number(tail, end + 16, 4);
  if (directory == kIn64Bits || directory_bytes == kIn64Bits) {
    fail(ErrorCode::kUnsupported,
         file_.path() + " is a zip archive of the 64-bit kind; at most 4 GiB are supported");
  }
  directory_ = directory;
  const uint64_t end_offset = file_.size() - tail_bytes + end;
  if (uint64_t{directory} + directory_bytes > end_offset) {
    failHere("has a zip directory from byte " + std::to_string(directory) + " of " +
             std::to_string(directory_bytes) + " bytes, which must end before byte " +
             std::to_string(end_offset));
  }
  std::vector<char> bytes(directory_bytes);
  file_.readAt(directory, bytes.data(), bytes.size());
  size_t at = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const auto where = [&] { return "at byte " + std::to_string(directory_ + at); };
    if (bytes.size() - at < kDirectoryBytes || number(bytes, at, 4) != kDirectorySignature) {
      failHere("has a damaged zip directory " + where() + ": entry " + std::to_string(i) + " of " +
               std::to_string(count) + " does not start there");
    }
    const uint32_t flags = number(bytes, at + 8, 2);
    const uint32_t method = number(bytes, at + 10, 2);
    Entry entry;
    entry.checksum = number(bytes, at + 16, 4);
    entry.stored_bytes = number(bytes, at + 20, 4);
    entry.whole_bytes = number(bytes, at + 24, 4);
    const size_t name_bytes = number(bytes, at + 28, 2);
    const size_t more_bytes = number(bytes, at + 30, 2) + number(bytes, at + 32, 2);
    entry.header = number(bytes, at + 42, 4);
    if (bytes.size() - at - kDirectoryBytes < name_bytes + more_bytes) {
      failHere("has a damaged zip directory " + where() + ": an entry's name leaves it");
    }
    const std::string name(bytes.data() + at + kDirectoryBytes, name_bytes);
    if (leavesFolder(name)) {
      failHere("has a zip entry " + where() + " named '" + shown(name) +
               "'; names inside the archive are needed, without '..'");
    }
    at += kDirectoryBytes + name_bytes + more_bytes;
    if (name.back() == '/') continue;
    if ((flags & kEncrypted) != 0 || (method != kStored && method != kDeflated)) {
      fail(ErrorCode::kUnsupported,
           file_.path() + ": zip entry '" + shown(name) + "' is " +
               ((flags & kEncrypted) != 0 ? std::string("encrypted")
                                          : "compressed by method " + std::to_string(method)) +
               "; stored and deflated entries are supported");
    }
    entry.deflated = method == kDeflated;
    const uint64_t largest =
        entry.deflated ? entry.stored_bytes * kMaxDeflateRatio : entry.stored_bytes;
    if (entry.header + kEntryBytes + name_bytes + entry.stored_bytes > directory_ ||
        entry.whole_bytes > largest || (!entry.deflated && entry.whole_bytes != largest)) {
      failHere("has a zip entry '" + shown(name) + "' that claims " +
               std::to_string(entry.stored_bytes) + " bytes from byte " +
               std::to_string(entry.header) + " and " + std::to_string(entry.whole_bytes) +
               " when unpacked, which cannot be");
    }
    if (!entries_.emplace(name, entry).second) {
      failHere("has two zip entries named '" + shown(name) + "'");
    }
  }
}

const ZipReader::Entry& ZipReader::find(const std::string& name) const {
  const auto found = entries_.find(name);
  if (found == entries_.end()) {
    failHere("has no file '" + shown(name) + "' in its zip archive");
  }
  return found->second;
}

const std::string& ZipReader::firstName() const {
  if (entries_.empty()) failHere("has no file in its zip archive");
  return std::min_element(
             entries_.begin(), entries_.end(),
             [](const auto& a, const auto& b) { return a.second.header < b.second.header; })
      ->first;
}

uint64_t ZipReader::storedBytes(const std::string& name) const {
  return find(name).stored_bytes;
}

std::vector<uint8_t> ZipReader::read(const std::string& name, uint64_t limit) const {
  const Entry& entry = find(name);
  if (entry.whole_bytes > limit) {
    failHere("has a file '" + shown(name) + "' of " + std::to_string(entry.whole_bytes) +
             " bytes in its zip archive; at most " + std::to_string(limit) + " belong there");
  }
  std::vector<char> header(kEntryBytes);
  file_.readAt(entry.header, header.data(), header.size());
  const uint64_t data = entry.header + kEntryBytes + number(header, 26, 2) + number(header, 28, 2);
  if (number(header, 0, 4) != kEntrySignature || data + entry.stored_bytes > directory_) {
    failHere("has no zip entry '" + shown(name) + "' at byte " + std::to_string(entry.header) +
             ", where its directory says");
  }
  std::vector<uint8_t> stored(static_cast<size_t>(entry.stored_bytes));
  file_.readAt(data, stored.data(), stored.size());
  const std::string what = file_.path() + ": " + name;
  const StipplePackingTable& packing = packingTable();
  std::vector<uint8_t> whole;
  if (entry.deflated) {
    whole.resize(static_cast<size_t>(entry.whole_bytes));
    callMedia([&](StippleMediaStatus* status) {
      packing.zip_inflate(what.c_str(), stored.data(), stored.size(), whole.data(), whole.size(),
                          status);
    });
  } else {
    whole = std::move(stored);
  }
  if (packing.zip_checksum(whole.data(), whole.size()) != entry.checksum) {
    fail(ErrorCode::kFormat, what + " is damaged: its checksum is not the archive's");
  }
  return whole;
}

void ZipWriter::add(const std::string& name, const std::vector<uint8_t>& bytes) {
  const uint64_t data = offset_ + kEntryBytes + name.size();
  uint64_t padding = (alignment_ - data % alignment_) % alignment_;
  if (padding > 0 && padding < kExtraHead) padding += alignment_;
  const uint64_t end = data + padding + bytes.size();
  // The directory follows; 64 KiB are far more than the dozen entries of a splat file take.
  if (end + (1 << 16) >= kIn64Bits || count_ >= std::numeric_limits<uint16_t>::max()) {
    fail(ErrorCode::kUnsupported, "the zip archive would have " + std::to_string(end) +
                                      " bytes; less than 4 GiB can be written");
  }
  std::string common;
  append(common, 20, 2);       // version 2.0 can read it
  append(common, 1 << 11, 2);  // names are UTF-8
  append(common, kStored, 2);
  append(common, 0, 2);
  append(common, kNoDate, 2);
  append(common, packingTable().zip_checksum(bytes.data(), bytes.size()), 4);
  append(common, static_cast<uint32_t>(bytes.size()), 4);
  append(common, static_cast<uint32_t>(bytes.size()), 4);
  append(common, static_cast<uint32_t>(name.size()), 2);

  std::string header;
  append(header, kEntrySignature, 4);
  header += common;
  append(header, static_cast<uint32_t>(padding), 2);
  header += name;
  if (padding > 0) {
    append(header, kPaddingField, 2);
    append(header, static_cast<uint32_t>(padding - kExtraHead), 2);
    header.append(static_cast<size_t>(padding - kExtraHead), '\0');
  }
  file_.write(header.data(), header.size());
  file_.write(bytes.data(), bytes.size());

  append(directory_, kDirectorySignature, 4);
  append(directory_, 20, 2);
  directory_ += common;
  append(directory_, 0, 2);  // no extra field
  append(directory_, 0, 2);  // no comment
  append(directory_, 0, 2);  // disk
  append(directory_, 0, 2);  // internal attributes
  append(directory_, 0, 4);  // external attributes
  append(directory_, static_cast<uint32_t>(offset_), 4);
  directory_ += name;
  offset_ = end;
  ++count_;
}

void ZipWriter::finish() {
  std::string end;
  append(end, kEndSignature, 4);
  append(end, 0, 4);  // one disk
  append(end, count_, 2);
  append(end, count_, 2);
  append(end, static_cast<uint32_t>(directory_.size()), 4);
  append(end, static_cast<uint32_t>(offset_), 4);
  append(end, 0, 2);  // no comment
  file_.write(directory_.data(), directory_.size());
  file_.write(end.data(), end.size());
}

}  // namespace stipple
