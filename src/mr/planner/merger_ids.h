#pragma once

#include <set>
#include <string>

#include "mr/scene/scene.h"

namespace mr::planner {

/// Ids for new mergers that no sensor and no root has.
class MergerIds {
 public:
  explicit MergerIds(const Scene& scene) : root(scene.mergers.back().id) {
    taken_.insert(root);
    for (const SensorConfig& sensor : scene.sensors) taken_.insert(sensor.id);
  }
  std::string next(const std::string& kind, int number) {
    std::string id = kind + "-" + std::to_string(number);
    while (!taken_.insert(id).second) id += "x";
    return id;
  }
  const std::string root;

 private:
  std::set<std::string> taken_;
};

}  // namespace mr::planner
