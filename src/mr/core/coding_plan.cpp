#include "mr/core/coding_plan.h"

namespace mr {

std::vector<std::string> CodingPlan::problems() const {
  std::vector<std::string> out = out_of_range({{"decimation.ratio", decimation.ratio, {0, 1}},
                                               {"decimation.error_m", decimation.error_m, {0, 1}},
                                               {"still_error_m", still_error_m, {0, 1}},
                                               {"mesh_speed", mesh_speed, {0, 10}},
                                               {"texture_scale", texture_scale, kTextureScale},
                                               {"texture_qp", texture_qp, {0, 51}},
                                               {"plate_scale", plate_scale, kTextureScale},
                                               {"plate_qp", plate_qp, {0, 51}}});
  if (decimation.ratio == 0 && decimation.error_m == 0)
    out.push_back("decimation.ratio may be 0 only with an error_m");
  return out;
}

const CodingPlan& ScenePlan::of(SensorId sensor) const {
  const auto found = by_sensor.find(sensor);
  return found == by_sensor.end() ? sensors : found->second;
}

std::vector<std::string> ScenePlan::problems() const {
  std::vector<std::string> out = prefixed("sensors: ", sensors.problems());
  append(out, prefixed("root: ", root.problems()));
  for (const auto& [sensor, plan] : by_sensor)
    append(out, prefixed("sensor " + std::to_string(number_of(sensor)) + ": ", plan.problems()));
  if (by_sensor.size() > kMaxSensors) out.push_back("by_sensor names too many sensors");
  return out;
}

}  // namespace mr
