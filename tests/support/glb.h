#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/kit/image_io.h"

/// Binary glTF files made by hand, right and wrong ones.
namespace mr::test {

struct GlbOptions {
  std::optional<ImageRgb> picture{};  ///< laid over x and y of the mesh's box, v downwards
  Vec3f factor{1, 1, 1};
  std::vector<Vec3f> colors{};  ///< [V]
  int wrap = 10497;
  float u_scale = 1;
  bool indexed = true;
  nlohmann::json nodes = nlohmann::json::parse(R"([{"mesh": 0}])");
  std::function<void(nlohmann::json&)> change{};  ///< last, before writing
};

/// The JSON and the binary part side by side.
struct GlbParts {
  nlohmann::json json;
  std::vector<std::byte> binary;

  int add_view(std::span<const std::byte> bytes) {
    binary.resize((binary.size() + 3) / 4 * 4);
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}});
    binary.insert(binary.end(), bytes.begin(), bytes.end());
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }
  template <typename T>
  int add(const std::vector<T>& values, int component, const char* type, std::size_t count) {
    json["accessors"].push_back({{"bufferView", add_view(std::as_bytes(std::span(values)))},
                                 {"componentType", component},
                                 {"type", type},
                                 {"count", count}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }
};

inline std::vector<std::byte> assembled(GlbParts parts) {
  std::string text = parts.json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  parts.binary.resize((parts.binary.size() + 3) / 4 * 4);
  std::vector<std::byte> out;
  const auto put = [&](const void* from, std::size_t bytes) {
    const auto* first = static_cast<const std::byte*>(from);
    out.insert(out.end(), first, first + bytes);
  };
  const std::size_t total = 28 + text.size() + parts.binary.size();
  for (const std::size_t word :
       {std::size_t{0x46546C67}, std::size_t{2}, total, text.size(), std::size_t{0x4E4F534A}}) {
    const auto narrow = static_cast<std::uint32_t>(word);
    put(&narrow, 4);
  }
  put(text.data(), text.size());
  const auto length = static_cast<std::uint32_t>(parts.binary.size()), kind = 0x004E4942u;
  put(&length, 4), put(&kind, 4);
  put(parts.binary.data(), parts.binary.size());
  return out;
}

inline void add_picture(GlbParts& parts, const Mesh& mesh, const GlbOptions& options,
                        nlohmann::json& attributes) {
  Box3f box;
  for (const Vec3f p : mesh.positions) box.add(p);
  std::vector<Vec2f> uvs;
  for (const Vec3f p : mesh.positions)
    uvs.push_back({(p.x - box.low.x) / (box.high.x - box.low.x) * options.u_scale,
                   (box.high.y - p.y) / (box.high.y - box.low.y)});
  attributes["TEXCOORD_0"] = parts.add(uvs, 5126, "VEC2", uvs.size());
  const auto png = kit::encode_png(*options.picture);
  parts.json["images"] = {{{"mimeType", "image/png"}, {"bufferView", parts.add_view(*png)}}};
  parts.json["samplers"] = {{{"wrapS", options.wrap}, {"wrapT", options.wrap}}};
  parts.json["textures"] = {{{"source", 0}, {"sampler", 0}}};
  parts.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
}

/// One mesh of one material as a .glb file; accessor 0 holds the positions.
inline std::vector<std::byte> glb_of(const Mesh& in, const GlbOptions& options = {}) {
  using Json = nlohmann::json;
  Mesh mesh = in;
  if (!options.indexed) {
    mesh.positions.clear();
    for (std::size_t t = 0; t < in.triangles.size(); ++t)
      for (int i = 0; i < 3; ++i) mesh.positions.push_back(in.corner(t, i));
  }
  GlbParts parts;
  const auto& factor = options.factor;
  parts.json["asset"] = {{"version", "2.0"}};
  parts.json["scene"] = 0;
  parts.json["scenes"] = Json::array({{{"nodes", {0}}}});
  parts.json["nodes"] = options.nodes;
  parts.json["materials"] = Json::array({Json::object()});
  parts.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {factor.x, factor.y,
                                                                           factor.z, 1};
  Json attributes{{"POSITION", parts.add(mesh.positions, 5126, "VEC3", mesh.positions.size())}};
  if (!options.colors.empty())
    attributes["COLOR_0"] = parts.add(options.colors, 5126, "VEC3", options.colors.size());
  if (options.picture) add_picture(parts, mesh, options, attributes);
  Json primitive{{"attributes", attributes}, {"material", 0}};
  if (options.indexed)
    primitive["indices"] = parts.add(mesh.triangles, 5125, "SCALAR", 3 * mesh.triangles.size());
  parts.json["meshes"] = Json::array({{{"primitives", Json::array({primitive})}}});
  parts.json["buffers"] = Json::array({{{"byteLength", parts.binary.size()}}});
  if (options.change) options.change(parts.json);
  return assembled(std::move(parts));
}

}  // namespace mr::test
