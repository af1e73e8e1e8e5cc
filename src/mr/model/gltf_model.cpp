#include "mr/model/gltf_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <fstream>  // needed by tinygltf without file access, which does not include it
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>

#include "mr/core/pose.h"
#include "mr/kit/image_io.h"

// Pictures and files are read by our own code, which knows their limits.
#define TINYGLTF_IMPLEMENTATION
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#include <tiny_gltf.h>

namespace mr::model {
namespace {

constexpr std::uint32_t kMaxJsonBytes = 32u << 20;
constexpr int kMaxJsonDepth = 64;
constexpr std::size_t kMaxVertices = 3 * kMaxModelTriangles;
constexpr std::size_t kMaxPixels = 128'000'000;

Error corrupt_model(std::string what) { return {Error::Cause::corrupt, std::move(what)}; }
Error unsupported_model(std::string what) { return {Error::Cause::unsupported, std::move(what)}; }
Error too_large_model(std::string what) { return {Error::Cause::too_large, std::move(what)}; }

/// Sanitizes a library's message, which may quote the file, to one line of plain text.
std::string one_line(std::string text) {
  for (char& c : text)
    if (c < ' ' || c > '~') c = ' ';
  text.resize(std::min<std::size_t>(text.size(), 200));
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

// --- the container, before tinygltf sees it

std::uint32_t word_at(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + at, sizeof word);
  return word;
}

Result<std::string_view> json_of(std::span<const std::byte> bytes) {
  constexpr std::uint32_t kMagic = 0x46546C67, kJson = 0x4E4F534A;
  if (bytes.size() > kMaxModelBytes) return too_large_model("a model of over 512 MiB");
  if (bytes.size() < 20 || word_at(bytes, 0) != kMagic) return corrupt_model("no binary glTF file");
  if (word_at(bytes, 4) != 2) return unsupported_model("glTF of another version than 2");
  if (word_at(bytes, 8) > bytes.size()) return corrupt_model("the file is cut off");
  const std::uint32_t length = word_at(bytes, 12);
  if (word_at(bytes, 16) != kJson || length > bytes.size() - 20)
    return corrupt_model("the file does not start with JSON");
  if (length > kMaxJsonBytes) return too_large_model("its JSON is longer than 32 MiB");
  return std::string_view(reinterpret_cast<const char*>(bytes.data()) + 20, length);
}

/// Limits nesting: tinygltf is recursive, so deep nesting would overflow the stack.
bool nested_too_deep(std::string_view json) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (quoted && c == '\\') {
      ++i;
    } else if (c == '"') {
      quoted = !quoted;
    } else if (!quoted && (c == '[' || c == '{')) {
      if (++depth > kMaxJsonDepth) return true;
    } else if (!quoted && (c == ']' || c == '}')) {
      --depth;
    }
  }
  return false;
}

/// tinygltf copies the binary chunk for every buffer and may look for others elsewhere.
Status check_container(std::span<const std::byte> bytes) {
  const auto text = json_of(bytes);
  if (!text) return text.error();
  if (nested_too_deep(*text)) return corrupt_model("its JSON is nested too deep");
  const auto json = nlohmann::json::parse(*text, nullptr, false);
  if (!json.is_object()) return corrupt_model("its JSON is broken");
  const auto buffers = json.find("buffers");
  if (buffers == json.end()) return {};
  if (!buffers->is_array()) return corrupt_model("its buffers are no list");
  for (const auto& buffer : *buffers)
    if (!buffer.is_object() || buffer.contains("uri") || buffers->size() > 1)
      return unsupported_model("its data must lie in the file's own binary part");
  return {};
}

/// Defers the decoding of pictures until their bytes are checked; keeps those embedded in the JSON.
bool keep_picture(tinygltf::Image* image, const int, std::string*, std::string*, int, int,
                  const unsigned char* bytes, int size, void*) {
  if (image->bufferView < 0) image->image.assign(bytes, bytes + size);
  return true;
}

Result<tinygltf::Model> parse(std::span<const std::byte> bytes) {
  tinygltf::TinyGLTF loader;
  loader.SetImageLoader(&keep_picture, nullptr);
  tinygltf::Model gltf;
  std::string error, warning;
  const bool ok = loader.LoadBinaryFromMemory(&gltf, &error, &warning,
                                              reinterpret_cast<const unsigned char*>(bytes.data()),
                                              static_cast<unsigned>(bytes.size()), "", 0);
  if (!ok) return corrupt_model("it is no glTF: " + one_line(error));
  static const std::set<std::string> kKnown = {"KHR_materials_unlit", "KHR_mesh_quantization"};
  for (const std::string& name : gltf.extensionsRequired)
    if (!kKnown.contains(name))
      return unsupported_model("it needs the extension " + one_line(name));
  return gltf;
}

// --- accessors

template <typename T>
const T* find(const std::vector<T>& list, int index) {
  const bool there = index >= 0 && static_cast<std::size_t>(index) < list.size();
  return there ? &list[static_cast<std::size_t>(index)] : nullptr;
}

/// Bytes of a buffer view; none when it does not lie in its buffer.
std::optional<std::span<const unsigned char>> bytes_of(const tinygltf::Model& gltf, int view) {
  const tinygltf::BufferView* found = find(gltf.bufferViews, view);
  const tinygltf::Buffer* buffer = found ? find(gltf.buffers, found->buffer) : nullptr;
  if (!buffer || found->byteOffset > buffer->data.size() ||
      found->byteLength > buffer->data.size() - found->byteOffset)
    return std::nullopt;
  return std::span(buffer->data).subspan(found->byteOffset, found->byteLength);
}

/// Numbers in a buffer, all of which are there.
struct Elements {
  std::span<const unsigned char> bytes;
  std::size_t count = 0, stride = 0;
  int type = 0;             ///< component type as OpenGL counts them
  int components = 0;       ///< of each element
  std::size_t size = 0;     ///< bytes of a component
  bool normalized = false;  ///< integers stand for 0..1 or -1..1

  template <typename T>
  T raw(std::size_t i, int component) const {
    T value{};
    std::memcpy(&value, bytes.data() + i * stride + component * size, sizeof value);
    return value;
  }
  std::uint32_t integer(std::size_t i) const {
    if (size == 1) return raw<std::uint8_t>(i, 0);
    if (size == 2) return raw<std::uint16_t>(i, 0);
    return raw<std::uint32_t>(i, 0);
  }
  double real(std::size_t i, int component) const {
    const auto scaled = [&](double value, double most) {
      return normalized ? std::max(value / most, -1.0) : value;
    };
    switch (type) {
      case TINYGLTF_COMPONENT_TYPE_BYTE:
        return scaled(raw<std::int8_t>(i, component), 127);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return scaled(raw<std::uint8_t>(i, component), 255);
      case TINYGLTF_COMPONENT_TYPE_SHORT:
        return scaled(raw<std::int16_t>(i, component), 32767);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return scaled(raw<std::uint16_t>(i, component), 65535);
      default:
        return raw<float>(i, component);
    }
  }
};

/// Bytes of a component; 0 for a type that glTF does not know.
std::size_t component_bytes(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

int component_count(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return 1;
    case TINYGLTF_TYPE_VEC2:
      return 2;
    case TINYGLTF_TYPE_VEC3:
      return 3;
    case TINYGLTF_TYPE_VEC4:
      return 4;
    default:
      return 0;
  }
}

Result<Elements> elements_of(const tinygltf::Model& gltf, int accessor) {
  const std::string name = "accessor " + std::to_string(accessor);
  const tinygltf::Accessor* a = find(gltf.accessors, accessor);
  if (!a) return corrupt_model(name + " is not there");
  if (a->sparse.isSparse) return unsupported_model(name + " is sparse");
  const auto view = bytes_of(gltf, a->bufferView);
  if (!view) return corrupt_model(name + " has no data in the file");
  Elements out;
  out.type = a->componentType, out.size = component_bytes(out.type);
  out.components = component_count(a->type);
  out.count = a->count, out.normalized = a->normalized;
  const std::size_t element = out.size * static_cast<std::size_t>(out.components);
  if (element == 0) return unsupported_model(name + " is of a type that is not read");
  const std::size_t stride = gltf.bufferViews[static_cast<std::size_t>(a->bufferView)].byteStride;
  out.stride = stride == 0 ? element : stride;
  const std::size_t room = view->size();
  if (out.stride < element || a->byteOffset > room || out.count > room ||
      (out.count > 0 && (out.count - 1) * out.stride + element > room - a->byteOffset))
    return corrupt_model(name + " reaches beyond its data");
  out.bytes = view->subspan(a->byteOffset);
  return out;
}

// --- nodes

/// p_a = linear · p_b + offset.
struct Affine {
  Mat3 linear;
  Vec3d offset;

  friend Vec3d operator*(const Affine& T, Vec3d p) { return T.linear * p + T.offset; }
  friend Affine operator*(const Affine& a, const Affine& b) {
    return {a.linear * b.linear, a * b.offset};
  }
};

bool finite(const Affine& T) {
  return is_finite(T.offset) &&
         std::ranges::all_of(T.linear.m, [](double v) { return std::isfinite(v); });
}

Mat3 rotation_of(double x, double y, double z, double w) {
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),  //
           2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),  //
           2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
}

Result<Affine> transform_of(const tinygltf::Node& node) {
  const auto &m = node.matrix, &t = node.translation, &r = node.rotation, &s = node.scale;
  const auto fits = [](const std::vector<double>& v, std::size_t size) {
    return v.empty() || v.size() == size;
  };
  if (!fits(m, 16) || !fits(t, 3) || !fits(r, 4) || !fits(s, 3))
    return corrupt_model("a node's transform has too many numbers, or too few");
  Affine out;
  if (!m.empty()) {  // by columns
    out.linear = {{m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]}};
    out.offset = {m[12], m[13], m[14]};
  } else {
    if (!r.empty()) {
      const double size = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
      if (!(size > 1e-6)) return corrupt_model("a node's rotation is no quaternion");
      out.linear = rotation_of(r[0] / size, r[1] / size, r[2] / size, r[3] / size);
    }
    for (int i = 0; i < 9 && !s.empty(); ++i) out.linear.m[i] *= s[i % 3];
    if (!t.empty()) out.offset = {t[0], t[1], t[2]};
  }
  if (!finite(out)) return corrupt_model("a node's transform is not finite");
  return out;
}

struct PlacedMesh {
  int mesh = -1;
  Affine T_model_mesh;
};

/// The meshes of the default scene. Nodes must be a forest: otherwise traversal would not end.
Result<std::vector<PlacedMesh>> placed_meshes(const tinygltf::Model& gltf) {
  const tinygltf::Scene* scene = find(gltf.scenes, std::max(gltf.defaultScene, 0));
  if (!scene) return Error{Error::Cause::empty, "it has no scene to show"};
  struct Visit {
    int node;
    Affine T_model_parent;
  };
  std::vector<Visit> open;
  for (const int node : scene->nodes) open.push_back({node, {}});
  std::vector<bool> seen(gltf.nodes.size());
  std::vector<PlacedMesh> out;
  while (!open.empty()) {
    const Visit visit = open.back();
    open.pop_back();
    const tinygltf::Node* node = find(gltf.nodes, visit.node);
    if (!node) return corrupt_model("node " + std::to_string(visit.node) + " is not there");
    if (seen[static_cast<std::size_t>(visit.node)])
      return corrupt_model("node " + std::to_string(visit.node) + " hangs in its tree twice");
    seen[static_cast<std::size_t>(visit.node)] = true;
    const auto own = transform_of(*node);
    if (!own) return own.error();
    const Affine T_model_node = visit.T_model_parent * *own;
    if (!finite(T_model_node)) return corrupt_model("a node's transform is not finite");
    if (node->mesh >= 0) out.push_back({node->mesh, T_model_node});
    for (const int child : node->children) open.push_back({child, T_model_node});
  }
  return out;
}

// --- surfaces

class ModelReader {
 public:
  explicit ModelReader(const tinygltf::Model& gltf) : gltf_(gltf) {
    model_.pictures.resize(gltf.images.size());
  }

  Result<Model> read() {
    const auto meshes = placed_meshes(gltf_);
    if (!meshes) return meshes.error();
    for (const PlacedMesh& placed : *meshes) {
      const tinygltf::Mesh* mesh = find(gltf_.meshes, placed.mesh);
      if (!mesh) return corrupt_model("mesh " + std::to_string(placed.mesh) + " is not there");
      for (const tinygltf::Primitive& primitive : mesh->primitives)
        if (auto ok = add(primitive, placed.T_model_mesh); !ok) return ok.error();
    }
    if (triangles_ == 0) return Error{Error::Cause::empty, "it has no triangles"};
    return std::move(model_);
  }

 private:
  Status add(const tinygltf::Primitive& primitive, const Affine& T_model_mesh);
  Status add_positions(const tinygltf::Primitive& primitive, const Affine& T, ModelPart& part);
  Status add_triangles(const tinygltf::Primitive& primitive, ModelPart& part);
  Status add_colors(const tinygltf::Primitive& primitive, ModelPart& part) const;
  Status add_material(const tinygltf::Primitive& primitive, ModelPart& part);
  Status add_texture(const tinygltf::TextureInfo& info, const tinygltf::Primitive& primitive,
                     ModelPart& part);
  Status decode_picture(std::size_t index);

  const tinygltf::Model& gltf_;
  Model model_;
  std::size_t vertices_ = 0, triangles_ = 0, pixels_ = 0;
};

Status ModelReader::add(const tinygltf::Primitive& primitive, const Affine& T_model_mesh) {
  if (primitive.mode >= TINYGLTF_MODE_POINTS && primitive.mode <= TINYGLTF_MODE_LINE_STRIP)
    return {};
  if (primitive.mode != TINYGLTF_MODE_TRIANGLES)
    return unsupported_model("it has strips or fans of triangles");
  ModelPart part;
  if (auto ok = add_positions(primitive, T_model_mesh, part); !ok) return ok;
  if (auto ok = add_triangles(primitive, part); !ok) return ok;
  if (part.triangles.empty()) return {};
  if (determinant(T_model_mesh.linear) < 0)  // a mirror turns every triangle over
    for (Triangle& t : part.triangles) std::swap(t[1], t[2]);
  if (auto ok = add_colors(primitive, part); !ok) return ok;
  if (auto ok = add_material(primitive, part); !ok) return ok;
  model_.parts.push_back(std::move(part));
  return {};
}

/// Index of the primitive's accessor for an attribute; -1: none.
int accessor_of(const tinygltf::Primitive& primitive, const std::string& attribute) {
  const auto found = primitive.attributes.find(attribute);
  return found == primitive.attributes.end() ? -1 : found->second;
}

bool holds_reals(const Elements& e) { return e.type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT; }

Status ModelReader::add_positions(const tinygltf::Primitive& primitive, const Affine& T,
                                  ModelPart& part) {
  const auto in = elements_of(gltf_, accessor_of(primitive, "POSITION"));
  if (!in) return in.error();
  if (in->components != 3 || !holds_reals(*in)) return corrupt_model("positions of a wrong type");
  vertices_ += in->count;
  if (vertices_ > kMaxVertices)
    return too_large_model("it has more than " + std::to_string(kMaxVertices) + " vertices");
  part.positions.resize(in->count);
  for (std::size_t v = 0; v < in->count; ++v) {
    part.positions[v] = T * Vec3d{in->real(v, 0), in->real(v, 1), in->real(v, 2)};
    if (!is_finite(part.positions[v])) return corrupt_model("a position is not finite");
  }
  return {};
}

Status ModelReader::add_triangles(const tinygltf::Primitive& primitive, ModelPart& part) {
  std::optional<Elements> indices;
  if (primitive.indices >= 0) {
    auto in = elements_of(gltf_, primitive.indices);
    if (!in) return in.error();
    const bool whole = in->type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
                       in->type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
                       in->type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    if (in->components != 1 || !whole) return corrupt_model("indices of a wrong type");
    indices = *in;
  }
  const std::size_t corners = indices ? indices->count : part.positions.size();
  if (corners % 3 != 0) return corrupt_model("a triangle without all its corners");
  triangles_ += corners / 3;
  if (triangles_ > kMaxModelTriangles)
    return too_large_model("it has more than " + std::to_string(kMaxModelTriangles) + " triangles");
  part.triangles.resize(corners / 3);
  for (std::size_t i = 0; i < corners; ++i) {
    const std::uint32_t v = indices ? indices->integer(i) : static_cast<std::uint32_t>(i);
    if (v >= part.positions.size())
      return corrupt_model("a triangle names a vertex that is not there");
    part.triangles[i / 3][i % 3] = v;
  }
  return {};
}

Status ModelReader::add_colors(const tinygltf::Primitive& primitive, ModelPart& part) const {
  const int accessor = accessor_of(primitive, "COLOR_0");
  if (accessor < 0) return {};
  const auto in = elements_of(gltf_, accessor);
  if (!in) return in.error();
  const bool real = in->type == TINYGLTF_COMPONENT_TYPE_FLOAT || in->normalized;
  if (in->components < 3 || !real || !holds_reals(*in))
    return corrupt_model("colours of a wrong type");
  if (in->count != part.positions.size()) return corrupt_model("not a colour for each vertex");
  part.colors.resize(in->count);
  for (std::size_t v = 0; v < in->count; ++v)
    for (int i = 0; i < 3; ++i) {
      const double value = in->real(v, i);
      if (!std::isfinite(value)) return corrupt_model("a colour is not finite");
      part.colors[v][i] = static_cast<float>(std::clamp(value, 0.0, 1.0));
    }
  return {};
}

Status ModelReader::add_material(const tinygltf::Primitive& primitive, ModelPart& part) {
  if (primitive.material < 0) return {};
  const tinygltf::Material* material = find(gltf_.materials, primitive.material);
  if (!material) return corrupt_model("a material is not there");
  const tinygltf::PbrMetallicRoughness& look = material->pbrMetallicRoughness;
  if (look.baseColorFactor.size() != 4)
    return corrupt_model("a colour factor without four numbers");
  for (int i = 0; i < 3; ++i) {
    const double value = look.baseColorFactor[static_cast<std::size_t>(i)];
    if (!std::isfinite(value)) return corrupt_model("a colour factor is not finite");
    part.factor[i] = static_cast<float>(std::clamp(value, 0.0, 1.0));
  }
  if (look.baseColorTexture.index < 0) return {};
  return add_texture(look.baseColorTexture, primitive, part);
}

Result<Wrap> wrap_of(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_REPEAT) return Wrap::repeat;
  if (mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return Wrap::mirror;
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::clamp;
  return corrupt_model("a sampler wraps in an unknown way");
}

Status ModelReader::add_texture(const tinygltf::TextureInfo& info,
                                const tinygltf::Primitive& primitive, ModelPart& part) {
  const tinygltf::Texture* texture = find(gltf_.textures, info.index);
  if (!texture || !find(gltf_.images, texture->source))
    return corrupt_model("a texture has no picture");
  if (texture->sampler >= 0) {
    const tinygltf::Sampler* sampler = find(gltf_.samplers, texture->sampler);
    if (!sampler) return corrupt_model("a sampler is not there");
    const auto u = wrap_of(sampler->wrapS), v = wrap_of(sampler->wrapT);
    if (!u || !v) return u ? v.error() : u.error();
    part.wrap = {*u, *v};
  }
  const int accessor = accessor_of(primitive, "TEXCOORD_" + std::to_string(info.texCoord));
  const auto in = elements_of(gltf_, accessor);
  if (!in) return in.error();
  const bool real = in->type == TINYGLTF_COMPONENT_TYPE_FLOAT || in->normalized;
  if (in->components != 2 || !real || !holds_reals(*in))
    return corrupt_model("texture coordinates of a wrong type");
  if (in->count != part.positions.size())
    return corrupt_model("not a texture coordinate for each vertex");
  part.uvs.resize(in->count);
  for (std::size_t v = 0; v < in->count; ++v) {
    part.uvs[v] = {static_cast<float>(in->real(v, 0)), static_cast<float>(in->real(v, 1))};
    if (!std::isfinite(part.uvs[v].x) || !std::isfinite(part.uvs[v].y))
      return corrupt_model("a texture coordinate is not finite");
  }
  part.picture = static_cast<std::size_t>(texture->source);
  return decode_picture(*part.picture);
}

Status ModelReader::decode_picture(std::size_t index) {
  ImageRgb& picture = model_.pictures[index];
  if (!picture.empty()) return {};
  const std::string name = "picture " + std::to_string(index);
  const tinygltf::Image& image = gltf_.images[index];
  std::span<const unsigned char> coded = image.image;
  if (image.bufferView >= 0) {
    const auto view = bytes_of(gltf_, image.bufferView);
    if (!view) return corrupt_model(name + " has no data in the file");
    coded = *view;
  }
  if (coded.empty()) return unsupported_model(name + " lies outside the file");
  auto decoded = kit::decode_color(std::as_bytes(coded));
  if (!decoded)
    return Error{decoded.error().cause, name + ": " + one_line(decoded.error().message)};
  pixels_ += static_cast<std::size_t>(decoded->width) * decoded->height;
  if (pixels_ > kMaxPixels)
    return too_large_model("its pictures have more than 128 million pixels");
  picture = std::move(*decoded);
  return {};
}

}  // namespace

Result<Model> read_glb(std::span<const std::byte> bytes) {
  try {
    if (auto ok = check_container(bytes); !ok) return ok.error();
    const auto gltf = parse(bytes);
    if (!gltf) return gltf.error();
    return ModelReader(*gltf).read();
  } catch (const std::exception& e) {  // of tinygltf, or no memory
    return corrupt_model("it cannot be read: " + one_line(e.what()));
  }
}

}  // namespace mr::model
