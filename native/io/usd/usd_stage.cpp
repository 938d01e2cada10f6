// Based on: Pixar, OpenUSD documentation, "Composition" and "UsdGeomXformable": opinions by
// strength (own, then sublayers, then references, payloads and inherited classes), operations of
// transformation in the order of xformOpOrder. Differs: no variants, no relocations; references in
// references keep the order in which they are found.
#include "io/usd/usd_stage.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <set>
#include <utility>

#include "base/error.h"

namespace stipple {

namespace {

constexpr int kMaxArcs = 100;          ///< of references in references
constexpr int kMaxDepth = 200;         ///< of prims in each other
constexpr size_t kMaxPrims = 100000;   ///< that are visited, each as often as it is referred to
constexpr size_t kMaxOpinions = 1000;  ///< of one prim
constexpr char kPointInstancer[] = "PointInstancer";
constexpr double kDegree = 3.14159265358979323846 / 180.0;

/// The matrix of one operation. In: kind, as "rotateXYZ"; numbers, as many as it needs.
std::optional<Mat4d> operation(const std::string& kind, const std::vector<double>& numbers) {
  Mat4d matrix = Mat4d::Identity();
  const auto turn = [&](char axis, double degrees) {
    const Vec3d around = Vec3d::Unit(axis - 'X');
    Mat4d turned = Mat4d::Identity();
    turned.topLeftCorner<3, 3>() = Eigen::AngleAxisd(degrees * kDegree, around).matrix();
    return turned;
  };
  if (kind == "translate" && numbers.size() == 3) {
    for (int i = 0; i < 3; ++i) matrix(i, 3) = numbers[static_cast<size_t>(i)];
  } else if (kind == "scale" && numbers.size() == 3) {
    for (int i = 0; i < 3; ++i) matrix(i, i) = numbers[static_cast<size_t>(i)];
  } else if (kind == "transform" && numbers.size() == 16) {
    // USD has rows where we have columns.
    matrix = Eigen::Map<const Mat4d>(numbers.data()).transpose();
  } else if (kind == "orient" && numbers.size() == 4) {
    const Eigen::Quaterniond turned(numbers[0], numbers[1], numbers[2], numbers[3]);
    if (!(turned.norm() > 0)) return std::nullopt;
    matrix.topLeftCorner<3, 3>() = turned.normalized().matrix();
  } else if (kind.size() == 7 && kind.starts_with("rotate") && numbers.size() == 1 &&
             kind[6] >= 'X' && kind[6] <= 'Z') {
    matrix = turn(kind[6], numbers[0]);
  } else if (kind.size() == 9 && kind.starts_with("rotate") && numbers.size() == 3) {
    // The first axis of the name turns first.
    for (size_t i = 6; i < 9; ++i) {
      if (kind[i] < 'X' || kind[i] > 'Z') return std::nullopt;
      matrix = turn(kind[i], numbers[static_cast<size_t>(kind[i] - 'X')]) * matrix;
    }
  } else {
    return std::nullopt;
  }
  return matrix;
}

/// A path from a layer's folder, with "." and ".." taken out; nothing where it leaves the stage's.
std::optional<std::string> inFolder(const std::string& folder, const std::string& path) {
  if (path.empty() || path.front() == '/' || path.find(':') != path.npos ||
      path.find('\\') != path.npos || path.find('\0') != path.npos) {
    return std::nullopt;
  }
  std::vector<std::string> parts;
  const std::string whole = folder + path;
  for (size_t start = 0; start <= whole.size();) {
    const size_t end = std::min(whole.find('/', start), whole.size());
    const std::string part = whole.substr(start, end - start);
    start = end + 1;
    if (part.empty() || part == ".") continue;
    if (part != "..") {
      parts.push_back(part);
    } else if (parts.empty()) {
      return std::nullopt;
    } else {
      parts.pop_back();
    }
  }
  std::string inside;
  for (const std::string& part : parts) inside += (inside.empty() ? "" : "/") + part;
  return inside;
}

}  // namespace

std::string UsdNode::type() const {
  for (const Opinion& opinion : opinions_) {
    if (!opinion.prim->type.empty()) return opinion.prim->type;
  }
  return "";
}

const UsdValue* UsdNode::value(const std::string& attribute) const {
  for (const Opinion& opinion : opinions_) {
    const auto found = opinion.prim->attributes.find(attribute);
    if (found == opinion.prim->attributes.end()) continue;
    if (const UsdValue* value = found->second.at(time_)) return value;
  }
  return nullptr;
}

void UsdNode::addTimes(std::set<double>& times) const {
  for (const Opinion& opinion : opinions_) {
    for (const auto& [name, attribute] : opinion.prim->attributes) {
      for (const auto& [time, value] : attribute.samples) times.insert(time);
    }
  }
}

std::string UsdNode::custom(const std::string& key) const {
  for (const Opinion& opinion : opinions_) {
    const auto found = opinion.prim->custom.find(key);
    if (found != opinion.prim->custom.end()) return found->second;
  }
  return "";
}

bool UsdNode::isThere() const {
  const auto strongest = [&](const auto& says) {
    return std::find_if(opinions_.begin(), opinions_.end(),
                        [&](const Opinion& opinion) { return says(*opinion.prim); });
  };
  const auto active = strongest([](const UsdPrim& prim) { return prim.is_active.has_value(); });
  if (active != opinions_.end() && !*active->prim->is_active) return false;
  // A class that is referred to is content of the definition that refers to it.
  const auto defined =
      strongest([](const UsdPrim& prim) { return prim.is_defined || prim.is_class; });
  return defined != opinions_.end() && !defined->prim->is_class;
}

bool UsdNode::isDrawn() const {
  const auto word = [&](const char* attribute) -> std::string_view {
    const UsdValue* said = value(attribute);
    return said == nullptr || said->words.empty() ? "" : std::string_view(said->words.front());
  };
  return isThere() && word("visibility") != "invisible" && word("purpose") != "proxy" &&
         word("purpose") != "guide";
}

bool UsdNode::leavesParent() const {
  const UsdValue* order = value("xformOpOrder");
  return order != nullptr && std::find(order->words.begin(), order->words.end(),
                                       "!resetXformStack!") != order->words.end();
}

Mat4d UsdNode::matrix(const std::string& path) const {
  constexpr std::string_view kInvert = "!invert!", kOperation = "xformOp:";
  Mat4d whole = Mat4d::Identity();
  const UsdValue* order = value("xformOpOrder");
  if (order == nullptr) return whole;
  for (std::string word : order->words) {
    if (word == "!resetXformStack!") {
      whole = Mat4d::Identity();
      continue;
    }
    const bool inverts = word.starts_with(kInvert);
    if (inverts) word = word.substr(kInvert.size());
    const UsdValue* numbers = value(word);
    std::optional<Mat4d> one;
    if (word.starts_with(kOperation) && numbers != nullptr) {
      const std::string rest = word.substr(kOperation.size());
      one = operation(rest.substr(0, rest.find(':')), numbers->numbers);
    }
    if (!one || !one->allFinite() || (inverts && one->determinant() == 0)) {
      fail(ErrorCode::kFormat, path + " is moved by '" + word.substr(0, 100) +
                                   "', which is no operation with the numbers that it needs");
    }
    whole = whole * (inverts ? Mat4d(one->inverse()) : *one);
  }
  return whole;
}

UsdStage::UsdStage(std::string name, std::string text, Loader loader)
    : name_(std::move(name)), loader_(std::move(loader)) {
  auto layer = std::make_unique<UsdLayer>(parseUsdText(text, name_));
  root_ = layer.get();
  layers_[""] = std::move(layer);
}

const UsdLayer* UsdStage::load(const std::string& path) {
  std::unique_ptr<UsdLayer>& layer = layers_[path];
  if (layer == nullptr) {
    layer = std::make_unique<UsdLayer>(parseUsdText(loader_(path), name_ + ": " + path));
  }
  return layer.get();
}

void UsdStage::addLayer(std::vector<UsdNode::Opinion>& opinions, const UsdLayer* layer,
                        const std::string& folder, int depth) {
  if (depth > kMaxArcs) {
    fail(ErrorCode::kFormat, name_ + " has layers that refer to each other in a circle");
  }
  opinions.push_back({layer, &layer->root, folder});
  for (const std::string& sublayer : layer->sublayers) {
    const std::optional<std::string> path = inFolder(folder, sublayer);
    if (!path) {
      fail(ErrorCode::kUnsupported, name_ + " has the sublayer '" + sublayer.substr(0, 100) +
                                        "', which is not in its folder");
    }
    addLayer(opinions, load(*path), path->substr(0, path->find_last_of('/') + 1), depth + 1);
  }
}

void UsdStage::add(std::vector<UsdNode::Opinion>& opinions, const UsdNode::Opinion& opinion,
                   int depth) {
  if (depth > kMaxArcs || opinions.size() > kMaxOpinions) {
    fail(ErrorCode::kFormat, name_ + " has references that lead in a circle, from the prim '" +
                                 opinion.prim->name.substr(0, 100) + "'");
  }
  opinions.push_back(opinion);
  // A copy: opinions may move.
  const UsdNode::Opinion from = opinion;
  for (const UsdArc& arc : from.prim->arcs) {
    std::vector<UsdNode::Opinion> layers;
    if (arc.layer.empty()) {
      addLayer(layers, from.layer, from.folder, 0);
    } else {
      const std::optional<std::string> path = inFolder(from.folder, arc.layer);
      if (!path) {
        fail(ErrorCode::kUnsupported,
             name_ + " refers to '" + arc.layer.substr(0, 100) + "', which is not in its folder");
      }
      addLayer(layers, load(*path), path->substr(0, path->find_last_of('/') + 1), 0);
    }
    const std::string target =
        arc.prim.empty() ? "/" + layers.front().layer->default_prim : arc.prim;
    bool is_found = false;
    for (const UsdNode::Opinion& layer : layers) {
      const UsdPrim* prim = layer.prim;
      for (size_t start = 1; prim != nullptr && start <= target.size();) {
        const size_t end = std::min(target.find('/', start), target.size());
        prim = prim->child(std::string_view(target).substr(start, end - start));
        start = end + 1;
      }
      if (prim == nullptr || prim == layer.prim) continue;
      is_found = true;
      add(opinions, {layer.layer, prim, layer.folder}, depth + 1);
    }
    if (!is_found) {
      fail(ErrorCode::kFormat, name_ + " refers to the prim '" + target.substr(0, 100) + "'" +
                                   (arc.layer.empty() ? "" : " of " + arc.layer.substr(0, 100)) +
                                   ", which is not there");
    }
  }
}

UsdNode UsdStage::root() const {
  UsdNode node;
  node.time_ = time_;
  return node;
}

std::vector<UsdNode> UsdStage::childrenOf(const UsdNode& parent) {
  std::vector<UsdNode> children;
  // What it has are prototypes, which are drawn at its points alone.
  if (parent.type() == kPointInstancer) return children;
  std::set<std::string> seen;
  for (const UsdNode::Opinion& strongest : parent.opinions_) {
    for (const auto& child : strongest.prim->children) {
      if (!seen.insert(child->name).second) continue;
      UsdNode& node = children.emplace_back(root());
      for (const UsdNode::Opinion& opinion : parent.opinions_) {
        if (const UsdPrim* prim = opinion.prim->child(child->name)) {
          add(node.opinions_, {opinion.layer, prim, opinion.folder}, 0);
        }
      }
    }
  }
  return children;
}

void UsdStage::requireBounds(int depth) {
  if (depth > kMaxDepth || ++visited_ > kMaxPrims) {
    fail(ErrorCode::kFormat, name_ + " has more than " + std::to_string(kMaxPrims) +
                                 " prims, or prims in each other without end");
  }
}

void UsdStage::walk(
    const UsdNode& node, const std::string& path, const Mat4d& matrix, int depth,
    const std::function<void(const UsdNode&, const std::string&, const Mat4d&)>& visit_one) {
  requireBounds(depth);
  if (!path.empty()) visit_one(node, path, matrix);
  for (const UsdNode& child : childrenOf(node)) {
    if (!child.isDrawn()) continue;
    const std::string child_path = path + "/" + child.name();
    const Mat4d own = child.matrix(name_ + ": " + child_path);
    walk(child, child_path, child.leavesParent() ? own : Mat4d(matrix * own), depth + 1, visit_one);
  }
}

void UsdStage::visit(
    const std::function<void(const UsdNode&, const std::string&, const Mat4d&)>& visit_one) {
  visited_ = 0;
  UsdNode top = root();
  addLayer(top.opinions_, root_, "", 0);
  walk(top, "", Mat4d::Identity(), 0, visit_one);
}

bool UsdStage::collectTimes(const UsdNode& node, const std::string& type, int depth,
                            std::set<double>& times) {
  requireBounds(depth);
  bool holds = node.type() == type;
  for (const UsdNode& child : childrenOf(node)) {
    if (child.isThere() && collectTimes(child, type, depth + 1, times)) holds = true;
  }
  if (holds) node.addTimes(times);
  return holds;
}

std::set<double> UsdStage::timesOf(const std::string& type) {
  visited_ = 0;
  UsdNode top = root();
  addLayer(top.opinions_, root_, "", 0);
  std::set<double> times;
  collectTimes(top, type, 0, times);
  return times;
}

}  // namespace stipple
