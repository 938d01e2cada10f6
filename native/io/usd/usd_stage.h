#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "io/usd/usd_text.h"
#include "math/vec.h"

namespace stipple {

/// A prim as it is after composition: opinions of several layers and places, the strongest first.
class UsdNode {
 public:
  std::string type() const;
  const std::string& name() const { return opinions_.front().prim->name; }
  /// The strongest value of an attribute at the stage's time (UsdStage::setTime). Null for none.
  const UsdValue* value(const std::string& attribute) const;
  /// Adds the times at which its attributes have values.
  void addTimes(std::set<double>& times) const;
  /// A string of customData, or empty.
  std::string custom(const std::string& key) const;
  bool isThere() const;  ///< defined, active and no class
  bool isDrawn() const;  ///< there, not invisible, no proxy and no guide
  /// Where the prim's transformation leads, columns as in all of Stipple. In: path, in messages.
  /// Errors: kFormat for operations without a value.
  Mat4d matrix(const std::string& path) const;
  bool leavesParent() const;  ///< its transformation does not continue that of its parent

 private:
  friend class UsdStage;
  struct Opinion {
    const UsdLayer* layer;
    const UsdPrim* prim;
    std::string folder;  ///< of the layer, relative to the stage's; with a '/' behind it, or empty
  };
  std::vector<Opinion> opinions_;
  std::optional<double> time_;
};

/// A layer with the layers and prims that it refers to.
class UsdStage {
 public:
  /// The text of a layer. In: path relative to the stage's folder, without '..'.
  using Loader = std::function<std::string(const std::string& path)>;

  /// In: name, of the file in messages. Errors: kFormat; kUnsupported for references that leave the
  /// folder, and for layers that are not text.
  UsdStage(std::string name, std::string text, Loader loader);

  const UsdLayer& layer() const { return *root_; }
  /// When values are asked for from now on; nothing, as at first: the ones without a time, or of
  /// their first.
  void setTime(std::optional<double> time) { time_ = time; }
  /// The times at which prims of a type, drawn or hidden, or what they lie in have values. In:
  /// type.
  std::set<double> timesOf(const std::string& type);
  /// Calls for every prim that is drawn, parents before children, until all have been seen. In:
  /// visit, given the prim, its path and where the stage's root has it.
  void visit(const std::function<void(const UsdNode& node, const std::string& path,
                                      const Mat4d& matrix)>& visit_one);

 private:
  void add(std::vector<UsdNode::Opinion>& opinions, const UsdNode::Opinion& opinion, int depth);
  void addLayer(std::vector<UsdNode::Opinion>& opinions, const UsdLayer* layer,
                const std::string& folder, int depth);
  const UsdLayer* load(const std::string& path);
  UsdNode root() const;
  /// In the order of the strongest opinions.
  std::vector<UsdNode> childrenOf(const UsdNode& parent);
  void requireBounds(int depth);
  bool collectTimes(const UsdNode& node, const std::string& type, int depth,
                    std::set<double>& times);
  void walk(const UsdNode& node, const std::string& path, const Mat4d& matrix, int depth,
            const std::function<void(const UsdNode&, const std::string&, const Mat4d&)>& visit_one);

  std::string name_;
  Loader loader_;
  std::map<std::string, std::unique_ptr<UsdLayer>> layers_;  ///< by path; the stage's own: ""
  const UsdLayer* root_;
  size_t visited_ = 0;
  std::optional<double> time_;
};

}  // namespace stipple
