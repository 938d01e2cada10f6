#pragma once

namespace stipple {

constexpr char kSogLevelsName[] = "lod-meta.json";
constexpr char kSogMetaName[] = "meta.json";

}  // namespace stipple
