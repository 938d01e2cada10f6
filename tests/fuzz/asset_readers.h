#pragma once

#include <filesystem>
#include <string>
#include <vector>

// Reading of asset files for the table of readers: each reads a file, or makes small valid ones in
// a folder.

namespace stipple::fuzz {

void readSurface(const std::filesystem::path& path);
void readHierarchy(const std::filesystem::path& path);
void readMotion(const std::filesystem::path& path);
void readLatent(const std::filesystem::path& path);
void readScaffold(const std::filesystem::path& path);
void readRelay(const std::filesystem::path& path);
std::vector<std::string> surfaceSeeds(const std::filesystem::path& folder);
std::vector<std::string> hierarchySeeds(const std::filesystem::path& folder);
std::vector<std::string> motionSeeds(const std::filesystem::path& folder);
std::vector<std::string> latentSeeds(const std::filesystem::path& folder);
std::vector<std::string> scaffoldSeeds(const std::filesystem::path& folder);
std::vector<std::string> relaySeeds(const std::filesystem::path& folder);

}  // namespace stipple::fuzz
