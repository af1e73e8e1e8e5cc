#include "mr/rate/sweep.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "mr/rate/stored_numbers.h"

namespace mr::rate {
namespace {

using Json = nlohmann::ordered_json;

/// The figures are no better.
double five_digits(double v) { return rounded_to(v, 5); }

Json rows(const auto& list, const auto& row) {
  Json out = Json::array();
  for (const auto& item : list) out.push_back(row(item));
  return out;
}

Json to_json(const Sweep& s) {
  Json out{{"scene", s.scene}, {"layers", s.layers},   {"moment", s.moment},
           {"fps", s.fps},     {"voxel_m", s.voxel_m}, {"features", Json::object()}};
  for (const Feature& f : s.features) out["features"][f.name] = five_digits(f.value);
  out["geometries"] = rows(s.geometries, [](const Sweep::Geometry& g) {
    return Json{g.error_voxels, g.bits, five_digits(g.bytes), g.triangles};
  });
  out["textures"] = rows(s.textures, [](const Sweep::Texture& t) {
    return Json{t.scale, t.qp, five_digits(t.key_bytes), five_digits(t.bytes)};
  });
  out["qualities"] = rows(s.qualities, [](const Sweep::Quality& q) {
    return Json{q.geometry, q.texture, five_digits(q.ssim), five_digits(q.moving_ssim)};
  });
  out["plates"] = rows(s.plates, [](const Sweep::Plates& p) {
    return Json{p.qp, five_digits(p.key_bytes), five_digits(p.ssim)};
  });
  out["stills"] = rows(s.stills, [](const Sweep::Still& p) {
    return Json{p.error_voxels, five_digits(p.bytes), five_digits(p.ssim)};
  });
  return out;
}

/// Calls `read` with each row of a list, which must have so many numbers.
void read_rows(const Json& list, std::size_t numbers, const auto& read) {
  constexpr std::size_t kMostRows = 10'000;
  if (!list.is_array() || list.size() > kMostRows) throw std::runtime_error("no list of rows");
  for (const Json& row : list) {
    if (!row.is_array() || row.size() != numbers)
      throw std::runtime_error("a row of another length");
    std::vector<double> values;
    for (const Json& v : row) values.push_back(v.get<double>());
    for (const double v : values)
      if (!(v >= 0 && v <= 1e12)) throw std::runtime_error("an impossible number");
    read(values);
  }
}

Sweep sweep_from(const Json& in) {
  Sweep s;
  s.scene = in.at("scene").get<std::string>();
  s.layers = in.at("layers").get<bool>(),
  s.moment = whole_number(in.at("moment").get<double>(), 0, 1'000'000'000);
  s.fps = in.at("fps").get<double>(), s.voxel_m = in.at("voxel_m").get<double>();
  if (!(s.fps >= 1 && s.fps <= 1000) || !(s.voxel_m > 0 && s.voxel_m <= 1))
    throw std::runtime_error("an impossible frame rate or voxel");
  for (const auto& [name, value] : in.at("features").items())
    s.features.push_back({name, value.get<double>()});
  read_rows(in.at("geometries"), 4, [&](const auto& v) {
    s.geometries.push_back(
        {v[0], whole_number(v[1], 0, 51), v[2], static_cast<std::uint64_t>(v[3])});
  });
  read_rows(in.at("textures"), 4, [&](const auto& v) {
    s.textures.push_back({v[0], whole_number(v[1], 0, 51), v[2], v[3]});
  });
  read_rows(in.at("qualities"), 4, [&](const auto& v) {
    const Sweep::Quality q{static_cast<std::size_t>(v[0]), static_cast<std::size_t>(v[1]), v[2],
                           v[3]};
    if (q.geometry >= s.geometries.size() || q.texture >= s.textures.size())
      throw std::runtime_error("a quality of no setting");
    s.qualities.push_back(q);
  });
  read_rows(in.at("plates"), 3, [&](const auto& v) {
    s.plates.push_back({whole_number(v[0], 0, 51), v[1], v[2]});
  });
  read_rows(in.at("stills"), 3, [&](const auto& v) { s.stills.push_back({v[0], v[1], v[2]}); });
  return s;
}

}  // namespace

/// One line for each list, so that a change of one moment is a small difference of the file.
std::string to_json(const SweepFile& file) {
  std::string out = "{\"version\": " + std::to_string(SweepFile::kVersion) +
                    ", \"scene_hash\": " + Json(file.scene_hash).dump() + ", \"sweeps\": [";
  for (std::size_t i = 0; i < file.sweeps.size(); ++i) {
    out += i == 0 ? "\n{" : ",\n{";
    bool first = true;
    const Json sweep = to_json(file.sweeps[i]);
    for (const auto& [key, value] : sweep.items()) {
      out += std::string(first ? "" : ",") + "\n \"" + key + "\": " + value.dump();
      first = false;
    }
    out += "}";
  }
  return out + "\n]}\n";
}

Result<SweepFile> sweeps_from_json(std::string_view text) {
  constexpr std::size_t kMostBytes = 16 << 20;
  if (text.size() > kMostBytes) return Error{Error::Cause::too_large, "sweeps of over 16 MiB"};
  try {
    const Json in = Json::parse(text);
    if (const int version = whole_number(in.at("version").get<double>(), 0, 1'000'000);
        version != SweepFile::kVersion)
      return Error{Error::Cause::unsupported, "sweeps of version " + std::to_string(version) +
                                                  "; this program reads version " +
                                                  std::to_string(SweepFile::kVersion) +
                                                  ": sweep again with 'meshreduce eval rd'"};
    SweepFile out;
    out.scene_hash = in.at("scene_hash").get<std::string>();
    for (const Json& sweep : in.at("sweeps")) out.sweeps.push_back(sweep_from(sweep));
    return out;
  } catch (const std::exception& wrong) {
    return Error{Error::Cause::corrupt, std::string("no sweeps: ") + wrong.what()};
  }
}

}  // namespace mr::rate
