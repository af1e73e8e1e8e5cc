#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "mr/core/file.h"
#include "mr/eval/floor_map.h"
#include "mr/eval/viewpoints.h"

// How viewpoints are kept: a JSON file.
namespace mr::eval {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "meshreduce-viewpoints";
constexpr int kVersion = 1;
constexpr std::uintmax_t kMostBytes = 8u << 20;
constexpr std::size_t kMostViews = 10'000, kLongestName = 64;

const char* name_of(ViewPlan::Kind kind) {
  return kind == ViewPlan::Kind::voronoi ? "voronoi" : "arcs";
}

/// To 1e-9 degrees, so that 60 comes back as 60.
double vertical_fov_deg(const Camera& camera) {
  const double fov = 2 * std::atan(0.5 * camera.height / camera.fy) * 180 / std::numbers::pi;
  return std::round(fov * 1e9) / 1e9;
}

Error corrupt_file(const std::string& why) { return {Error::Cause::corrupt, why}; }

// --- reading: nothing in the file is to be trusted

bool is_name(const Json& json) {
  if (!json.is_string()) return false;
  const auto& text = json.get_ref<const std::string&>();
  return !text.empty() && text.size() <= kLongestName &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

/// A member, or null where there is none.
const Json& member(const Json& json, const char* name) {
  static const Json none;
  const auto found = json.is_object() ? json.find(name) : json.end();
  return json.is_object() && found != json.end() ? *found : none;
}

Result<Camera> read_camera(const Json& json) {
  constexpr int kLargest_px = 16384;
  const Json &size = member(json, "picture"), &fov = member(json, "vertical_fov_deg");
  const auto side = [](const Json& v) {
    return v.is_number_integer() && v >= 1 && v <= kLargest_px ? v.get<int>() : 0;
  };
  if (!size.is_array() || size.size() != 2 || side(size[0]) == 0 || side(size[1]) == 0)
    return corrupt_file(fmt::format("picture is not [width, height], 1 to {} each", kLargest_px));
  if (!fov.is_number() || !(fov.get<double>() >= 1 && fov.get<double>() <= 175))
    return corrupt_file("vertical_fov_deg is not a number from 1 to 175");
  return picture_camera(side(size[0]), side(size[1]), fov.get<double>());
}

/// A pose exactly as it was written; one that is not rigid is refused.
Result<Pose> read_pose(const Json& json) {
  if (!json.is_array() || json.size() != 16)
    return corrupt_file("T_world_camera is not 16 numbers");
  std::array<double, 16> m{};
  for (int i = 0; i < 16; ++i) {
    if (!json[i].is_number()) return corrupt_file("T_world_camera is not 16 numbers");
    m[i] = json[i].get<double>();
  }
  if (const auto pose = pose_from_matrix(m, 1e-6); !pose) return corrupt_file(pose.error().message);
  return Pose{{{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}}, {m[3], m[7], m[11]}};
}

Result<render::Viewpoint> read_view(const Json& json, const Camera& camera) {
  if (!is_name(member(json, "name")))
    return corrupt_file(fmt::format("name is not 1 to {} plain characters", kLongestName));
  const auto pose = read_pose(member(json, "T_world_camera"));
  if (!pose) return pose.error();
  return render::Viewpoint{json.at("name").get<std::string>(), camera, *pose};
}

Result<ViewPlan> read_plan(const Json& json, const std::string& key) {
  if (member(json, "format") != kFormat) return corrupt_file("not a file of viewpoints");
  if (member(json, "version") != kVersion)
    return Error{Error::Cause::unsupported, fmt::format("version is not {}", kVersion)};
  if (!member(json, "key").is_string()) return corrupt_file("key is missing");
  if (!key.empty() && member(json, "key") != key)
    return Error{Error::Cause::invalid, "planned for other sensors or another room"};
  ViewPlan plan;
  const Json &kind = member(json, "kind"), &views = member(json, "views");
  if (kind != "voronoi" && kind != "arcs") return corrupt_file("kind is neither voronoi nor arcs");
  plan.kind = kind == "arcs" ? ViewPlan::Kind::arcs : ViewPlan::Kind::voronoi;
  const auto camera = read_camera(json);
  if (!camera) return camera.error();
  if (!views.is_array() || views.empty() || views.size() > kMostViews)
    return corrupt_file(fmt::format("views is not a list of 1 to {}", kMostViews));
  for (std::size_t i = 0; i < views.size(); ++i) {
    auto view = read_view(views[i], *camera);
    if (!view) return corrupt_file(fmt::format("views[{}]: {}", i, view.error().message));
    plan.views.push_back(std::move(*view));
  }
  return plan;
}

}  // namespace

Status write_viewpoints(const std::filesystem::path& file, const ViewPlan& plan,
                        const std::string& key) {
  const auto refuse = [&](const char* why) {
    return Error{Error::Cause::invalid, "cannot write " + file.string() + ": " + why};
  };
  if (plan.views.empty()) return refuse("there are no views");
  const Camera& camera = plan.views.front().camera;
  Json json = {{"format", kFormat},
               {"version", kVersion},
               {"key", key},
               {"kind", name_of(plan.kind)},
               {"picture", {camera.width, camera.height}},
               {"vertical_fov_deg", vertical_fov_deg(camera)},
               {"views", Json::array()}};
  for (const render::Viewpoint& view : plan.views) {
    if (!is_name(view.name)) return refuse("a view has no name, or a strange one");
    if (!(view.camera == camera)) return refuse("the views differ in their cameras");
    if (!pose_from_matrix(view.T_world_camera.matrix(), 1e-6)) return refuse("a pose is not rigid");
    json["views"].push_back(
        {{"name", view.name}, {"T_world_camera", view.T_world_camera.matrix()}});
  }
  try {
    return write_file(file, json.dump(1) + "\n");
  } catch (const Json::exception&) {  // the key is not UTF-8
    return refuse("the key is not text");
  }
}

Result<ViewPlan> read_viewpoints(const std::filesystem::path& file, const std::string& key) {
  const auto bytes = read_file(file, kMostBytes);
  if (!bytes) return bytes.error();
  const auto* const text = reinterpret_cast<const char*>(bytes->data());
  const Json json = Json::parse(text, text + bytes->size(), nullptr, false);
  auto plan = json.is_discarded() ? corrupt_file("not JSON") : read_plan(json, key);
  if (!plan) return Error{plan.error().cause, file.string() + ": " + plan.error().message};
  return plan;
}

}  // namespace mr::eval
