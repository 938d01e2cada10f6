#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace stipple {

/// An image of a series: its file's name ends in its number.
struct NumberedFrame {
  uint64_t number = 0;
  std::string file_name;
};

/// The digits at the end of a file's name, before its extension: 12 of "cam00_0012.png". Empty
/// where there are none, or more than nine without leading zeros.
std::optional<uint64_t> frameNumber(const std::filesystem::path& file_name);

/// The images of a folder whose names end in a number, ascending. In: like, the name of one of
/// them, which may lack its extension, or empty: only files that are called the same before their
/// number, with the same extension, count. A folder that is not there has none. Errors: kFormat for
/// two images of one number, with both names; kIo for a folder that cannot be listed.
std::vector<NumberedFrame> numberedFrames(const std::filesystem::path& folder,
                                          const std::filesystem::path& like = {});

/// Folders of a folder, but hidden ones, and its videos, by name. Errors: kIo.
std::vector<std::filesystem::path> foldersIn(const std::filesystem::path& folder);
std::vector<std::filesystem::path> videosIn(const std::filesystem::path& folder);

}  // namespace stipple
