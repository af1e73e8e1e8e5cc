#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>

#include "mr/kit/image_io.h"
#include "mr/kit/srgb.h"
#include "mr/model/mip_chain.h"
#include "mr/model/writers.h"

namespace mr::model {
namespace {

using Json = nlohmann::ordered_json;

// Names of glTF 2.0 (OpenGL's numbers).
enum : int {
  kFloat = 5126,
  kUint16 = 5123,
  kUint32 = 5125,
  kArrayBuffer = 34962,
  kElementArrayBuffer = 34963,
  kLinear = 9729,
  kClampToEdge = 33071,
};

/// The shortest turn that brings `up` to +Y, as the quaternion x, y, z, w: through the vector
/// halfway between, or half a turn about x where the two are opposite.
std::array<double, 4> turn_to_y(Vec3d up) {
  const Vec3d y{0, 1, 0};
  if (length(up + y) < 1e-6) return {1, 0, 0, 0};
  const Vec3d half = normalized(up + y), axis = cross(up, half);
  return {axis.x, axis.y, axis.z, dot(up, half)};
}

/// Builds the JSON and the binary chunk side by side.
struct GltfBuilder {
  Json json;
  Bytes binary;

  int add(const char* list, Json item) {
    json[list].push_back(std::move(item));
    return static_cast<int>(json[list].size() - 1);
  }

  int add_bytes(std::span<const std::byte> bytes, std::optional<int> target = std::nullopt) {
    binary.resize((binary.size() + 3) / 4 * 4);
    Json view{{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}};
    if (target) view["target"] = *target;
    binary.insert(binary.end(), bytes.begin(), bytes.end());
    return add("bufferViews", std::move(view));
  }

  int add_positions(const std::vector<Vec3f>& positions) {
    Box3f box;
    for (const Vec3f p : positions) box.add(p);
    return add("accessors",
               {{"bufferView", add_bytes(std::as_bytes(std::span(positions)), kArrayBuffer)},
                {"componentType", kFloat},
                {"count", positions.size()},
                {"type", "VEC3"},
                {"min", {box.low.x, box.low.y, box.low.z}},
                {"max", {box.high.x, box.high.y, box.high.z}}});
  }

  int add_uvs(const std::vector<Vec2f>& uvs) {
    return add("accessors", {{"bufferView", add_bytes(std::as_bytes(std::span(uvs)), kArrayBuffer)},
                             {"componentType", kFloat},
                             {"count", uvs.size()},
                             {"type", "VEC2"}});
  }

  /// Linear in 16 bits, from which every sRGB byte comes back; four of them, to be aligned.
  int add_colors(const std::vector<std::array<std::uint8_t, 3>>& colors) {
    Bytes bytes;
    bytes.reserve(colors.size() * 8);
    for (const auto& color : colors) {
      for (const std::uint8_t c : color)
        put(bytes, static_cast<std::uint16_t>(kit::to_linear(c) * 65535 + 0.5f));
      put(bytes, std::uint16_t{65535});
    }
    return add("accessors", {{"bufferView", add_bytes(bytes, kArrayBuffer)},
                             {"componentType", kUint16},
                             {"normalized", true},
                             {"count", colors.size()},
                             {"type", "VEC4"}});
  }

  /// In 16 bits where they suffice; 65535 would restart the primitive.
  int add_indices(const std::vector<Triangle>& triangles, std::size_t vertices) {
    const bool small = vertices <= 65535;
    Bytes bytes;
    bytes.reserve(triangles.size() * (small ? 6 : 12));
    for (const Triangle& triangle : triangles)
      for (const std::uint32_t vertex : triangle) {
        if (small)
          put(bytes, static_cast<std::uint16_t>(vertex));
        else
          put(bytes, vertex);
      }
    return add("accessors", {{"bufferView", add_bytes(bytes, kElementArrayBuffer)},
                             {"componentType", small ? kUint16 : kUint32},
                             {"count", 3 * triangles.size()},
                             {"type", "SCALAR"}});
  }

  /// Unlit: the pictures hold the light already.
  int add_material(std::string name, Json base) {
    base["metallicFactor"] = 0;
    return add("materials", {{"name", std::move(name)},
                             {"pbrMetallicRoughness", std::move(base)},
                             {"doubleSided", true},
                             {"extensions", {{"KHR_materials_unlit", Json::object()}}}});
  }

  int add_plain_material() {
    const float linear = kit::to_linear(kNeutralColor[0]);  // as factors are
    return add_material("no view", {{"baseColorFactor", {linear, linear, linear, 1}}});
  }

  Result<int> add_picture_material(StreamId stream, const ImageRgb& picture) {
    auto png = kit::encode_png(picture);
    if (!png) return png.error();
    const std::string name = "stream " + std::to_string(number_of(stream));
    const int image =
        add("images", {{"name", name}, {"mimeType", "image/png"}, {"bufferView", add_bytes(*png)}});
    if (!json.contains("samplers"))
      add("samplers", {{"magFilter", kLinear},
                       {"minFilter", kLinear},
                       {"wrapS", kClampToEdge},
                       {"wrapT", kClampToEdge}});
    const int texture = add("textures", {{"sampler", 0}, {"source", image}});
    return add_material(name, {{"baseColorTexture", {{"index", texture}}}});
  }

  Result<Json> primitive(const BakedPart& part, const Pictures& pictures) {
    Json attributes{{"POSITION", add_positions(part.positions)}};
    if (part.stream) attributes["TEXCOORD_0"] = add_uvs(part.uvs);
    if (!part.colors.empty()) attributes["COLOR_0"] = add_colors(part.colors);
    const int indices = add_indices(part.triangles, part.positions.size());
    Result<int> material =
        part.stream           ? add_picture_material(*part.stream, *pictures.at(*part.stream))
        : part.colors.empty() ? Result<int>(add_plain_material())
                              : Result<int>(add_material("background", Json::object()));
    if (!material) return material.error();
    return Json{{"attributes", attributes}, {"indices", indices}, {"material", *material}};
  }
};

/// Header, JSON chunk, binary chunk; both padded to 4 bytes.
Result<Bytes> assemble(std::string text, Bytes binary) {
  text.resize((text.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4);
  const std::uint64_t total = 12 + 8 + text.size() + 8 + binary.size();
  if (total > 0xFFFFFFFFu) return Error{Error::Cause::too_large, "a .glb file holds at most 4 GiB"};
  Bytes out;
  out.reserve(total);
  for (const std::uint32_t word : {0x46546C67u, 2u, static_cast<std::uint32_t>(total),
                                   static_cast<std::uint32_t>(text.size()), 0x4E4F534Au})
    put(out, word);
  put_text(out, text);
  put(out, static_cast<std::uint32_t>(binary.size()));
  put(out, 0x004E4942u);
  out.insert(out.end(), binary.begin(), binary.end());
  return out;
}

}  // namespace

Result<Bytes> to_glb(const std::vector<BakedPart>& parts, const Pictures& pictures, Vec3d up) {
  GltfBuilder gltf;
  gltf.json = {
      {"asset", {{"version", "2.0"}, {"generator", "MeshReduce"}}},
      {"extensionsUsed", {"KHR_materials_unlit"}},
      {"scene", 0},
      {"scenes", Json::array({{{"nodes", {0}}}})},
      {"nodes", Json::array({{{"name", "world"}, {"rotation", turn_to_y(up)}, {"mesh", 0}}})}};
  Json primitives = Json::array();
  for (const BakedPart& part : parts) {
    auto primitive = gltf.primitive(part, pictures);
    if (!primitive) return primitive.error();
    primitives.push_back(std::move(*primitive));
  }
  gltf.add("meshes", {{"name", "scene"}, {"primitives", std::move(primitives)}});
  gltf.add("buffers", {{"byteLength", gltf.binary.size()}});
  return assemble(gltf.json.dump(), std::move(gltf.binary));
}

}  // namespace mr::model
