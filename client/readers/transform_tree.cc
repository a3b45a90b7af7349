#include "client/readers/transform_tree.h"

#include <algorithm>

namespace mapkeep {

void TransformTree::Add(const PoseMessage& transform, bool is_static) {
  Link& link = links_[transform.child];
  link.parent = transform.frame;
  link.is_static = is_static;
  if (is_static) {
    link.fixed = transform.pose;
  } else {
    link.track.Add(transform.stamp, transform.pose);
  }
}

void TransformTree::Sort() {
  for (auto& [child, link] : links_) link.track.Sort();
}

std::vector<std::string> TransformTree::ChainOf(const std::string& frame) const {
  std::vector<std::string> chain = {frame};
  for (auto link = links_.find(frame); link != links_.end(); link = links_.find(chain.back())) {
    // A circle ends where it comes back.
    if (std::ranges::find(chain, link->second.parent) != chain.end()) break;
    chain.push_back(link->second.parent);
  }
  return chain;
}

std::optional<Pose> TransformTree::At(const std::string& ancestor, const std::string& frame, double time) const {
  Pose pose = Pose::Identity();
  for (const std::string& at : ChainOf(frame)) {
    if (at == ancestor) return pose;
    const auto link = links_.find(at);
    if (link == links_.end()) break;
    const std::optional<Pose> step = link->second.is_static ? link->second.fixed : link->second.track.At(time);
    if (!step.has_value()) return std::nullopt;
    pose = *step * pose;
  }
  return std::nullopt;
}

std::optional<Pose> TransformTree::Fixed(const std::string& other, const std::string& frame) const {
  const std::vector<std::string> above = ChainOf(other), mine = ChainOf(frame);
  for (const std::string& common : mine) {
    if (std::ranges::find(above, common) == above.end()) continue;
    if (Moves(common, frame) || Moves(common, other)) return std::nullopt;
    const std::optional<Pose> a = At(common, other, 0), b = At(common, frame, 0);
    if (!a.has_value() || !b.has_value()) return std::nullopt;
    return a->inverse() * *b;
  }
  return std::nullopt;
}

bool TransformTree::Moves(const std::string& ancestor, const std::string& frame) const {
  for (const std::string& at : ChainOf(frame)) {
    if (at == ancestor) return false;
    const auto link = links_.find(at);
    if (link != links_.end() && !link->second.is_static) return true;
  }
  return false;
}

}  // namespace mapkeep
