#include "io/views/ply_points.h"

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "io/splats/ply/ply_header.h"
#include "io/splats/ply/ply_rows.h"
#include "math/colour.h"

namespace stipple {

namespace {

constexpr size_t kBlockRows = 4096;
constexpr float kGrey = 0.5f;

std::optional<size_t> find(const PlyElement& element, const std::string& name) {
  for (size_t p = 0; p < element.properties.size(); ++p) {
    if (element.properties[p].name == name && !element.properties[p].is_list) return p;
  }
  return std::nullopt;
}

/// What a stored colour of 1 is.
float fullScale(PlyType type) {
  switch (type) {
    case PlyType::kUint8:
      return 255.0f;
    case PlyType::kUint16:
      return 65535.0f;
    default:
      return 1.0f;
  }
}

}  // namespace

PointSet readPlyPoints(const std::string& path, bool with_normals) {
  const InputFile file(path);
  const PlyHeader header = readPlyHeader(file);
  PlyRowReader rows(file, header);
  const PlyElement* vertices = nullptr;
  for (const PlyElement& element : header.elements) {
    if (element.name == "vertex") {
      vertices = &element;
      break;
    }
    rows.skip(element);
  }
  if (vertices == nullptr) fail(ErrorCode::kFormat, path + " has no element 'vertex'");

  struct Column {
    size_t property;
    std::vector<float>* values;
    size_t channel;
    size_t channels;
  };
  std::vector<Column> columns;
  PointSet points;
  for (size_t i = 0; i < 3; ++i) {
    const char* name = i == 0 ? "x" : i == 1 ? "y" : "z";
    const std::optional<size_t> property = find(*vertices, name);
    if (!property) fail(ErrorCode::kFormat, path + " has no vertex property '" + name + "'");
    columns.push_back({*property, &points.positions, i, 3});
  }
  const std::optional<size_t> colour[3] = {find(*vertices, "red"), find(*vertices, "green"),
                                           find(*vertices, "blue")};
  const bool has_colour = colour[0] && colour[1] && colour[2];
  for (size_t i = 0; has_colour && i < 3; ++i) {
    columns.push_back({*colour[i], &points.colours, i, 3});
  }
  const std::optional<size_t> normal[3] = {find(*vertices, "nx"), find(*vertices, "ny"),
                                           find(*vertices, "nz")};
  const bool has_normals = with_normals && normal[0] && normal[1] && normal[2];
  for (size_t i = 0; has_normals && i < 3; ++i) {
    columns.push_back({*normal[i], &points.normals, i, 3});
  }
  std::vector<float> times;
  const std::optional<size_t> time = find(*vertices, "time");
  if (time) columns.push_back({*time, &times, 0, 1});

  const size_t count = static_cast<size_t>(vertices->count);
  points.positions.resize(count * 3);
  points.colours.assign(count * 3, kGrey);
  points.opacities.assign(count, 1.0f);
  if (has_normals) points.normals.resize(count * 3);
  if (time) times.resize(count);
  const PlyRowLayout layout = rows.layout(*vertices);
  std::vector<char> block(std::min(count, kBlockRows) * layout.stride);
  for (size_t begin = 0; begin < count; begin += kBlockRows) {
    const size_t read = std::min(kBlockRows, count - begin);
    rows.read(*vertices, layout, read, block.data());
    for (const Column& column : columns) {
      extractPlyColumn(block.data(), layout.stride, read, layout.columns[column.property],
                       column.values->data() + begin * column.channels + column.channel,
                       column.channels);
    }
  }
  if (has_colour) {
    for (size_t i = 0; i < points.colours.size(); ++i) {
      points.colours[i] /= fullScale(vertices->properties[*colour[i % 3]].type);
    }
  }
  for (float& value : points.colours) value = srgbToLinear(value);
  try {
    requireFinite(points.positions.data(), points.positions.size(), 3, "position of vertex");
    requireFinite(points.normals.data(), points.normals.size(), 3, "normal of vertex");
    requireFinite(points.colours.data(), points.colours.size(), 3, "colour of vertex");
    requireFinite(times.data(), times.size(), 1, "time of vertex");
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
  points.times.assign(times.begin(), times.end());
  return points;
}

}  // namespace stipple
