#include "mr/core/coding_plan.h"

namespace mr {

std::vector<std::string> CodingPlan::problems() const {
  std::vector<std::string> out;
  const auto check = [&](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;
    out.push_back(std::string(name) + " must be from " + std::to_string(low) + " to " +
                  std::to_string(high));
  };
  check("decimation.ratio", decimation.ratio, 0, 1);
  check("decimation.error_m", decimation.error_m, 0, 1);
  check("still_error_m", still_error_m, 0, 1);
  check("mesh_speed", mesh_speed, 0, 10);
  check("texture_scale", texture_scale, 0, 16);
  check("texture_qp", texture_qp, 0, 51);
  return out;
}

std::vector<std::string> ScenePlan::problems() const {
  std::vector<std::string> out;
  for (const std::string& problem : sensors.problems()) out.push_back("sensors: " + problem);
  for (const std::string& problem : root.problems()) out.push_back("root: " + problem);
  return out;
}

}  // namespace mr
