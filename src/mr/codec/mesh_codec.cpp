#include "mr/codec/mesh_codec.h"

#include <draco/compression/expert_encode.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>

#include <algorithm>
#include <cstring>
#include <exception>
#include <numeric>
#include <optional>
#include <span>

#include "mr/codec/flat_triangles.h"

namespace mr::codec {
namespace {

using Color = std::array<std::uint8_t, 3>;

constexpr std::uint32_t kMaxTriangles = 1u << 20;
constexpr std::size_t kMaxPayload = 64u << 20;
constexpr std::size_t kMaxViews = 254;
constexpr std::uint8_t kNoViewLabel = 255;
constexpr std::uint32_t kNoLabel = 0xFFFFFFFFu;  // kNoSensor, kNoView

/// `count` triangles from `first` on, of a sensor or a view: what follows treats both alike.
struct LabelRun {
  std::uint32_t first = 0, count = 0, label = kNoLabel;
};

/// A mesh's runs, of whichever kind; a mesh without labels has one run of no view.
std::vector<LabelRun> label_runs(const Mesh& mesh) {
  std::vector<LabelRun> out;
  for (const SensorRun& run : mesh.sensors)
    out.push_back({run.first, run.count, number_of(run.id)});
  for (const ViewRun& run : mesh.views) out.push_back({run.first, run.count, number_of(run.id)});
  if (out.empty()) out.push_back({0, static_cast<std::uint32_t>(mesh.triangles.size()), kNoLabel});
  return out;
}

/// One label per triangle.
std::vector<std::uint32_t> triangle_labels(const Mesh& mesh) {
  std::vector<std::uint32_t> out(mesh.triangles.size());
  for (const LabelRun& run : label_runs(mesh))
    std::fill_n(out.begin() + run.first, run.count, run.label);
  return out;
}

template <typename Id>
std::vector<Id> ids_of(const std::vector<std::uint32_t>& labels) {
  std::vector<Id> out;
  out.reserve(labels.size());
  for (const std::uint32_t label : labels) out.push_back(Id{label});
  return out;
}

template <typename Id>
std::vector<std::uint32_t> numbers_of(const std::vector<Id>& ids) {
  std::vector<std::uint32_t> out;
  for (const Id id : ids) out.push_back(number_of(id));
  return out;
}
constexpr std::uint32_t kUnset = 0xFFFFFFFFu;

Error invalid_chunk(const std::string& what) { return {Error::Cause::invalid, "chunk: " + what}; }
Error corrupt_chunk(const std::string& what) { return {Error::Cause::corrupt, "chunk: " + what}; }

/// Numbers triples of integers, such as lattice points, in order of first use.
class Welder {
 public:
  explicit Welder(std::size_t expected) {
    std::size_t size = 16;
    while (size < 2 * expected) size *= 2;
    slots_.assign(size, kUnset);
    cells_.reserve(expected);
  }

  std::uint32_t index_of(Vec3i cell) {
    std::size_t slot = hash_cell(cell) & (slots_.size() - 1);
    while (slots_[slot] != kUnset && cells_[slots_[slot]] != cell)
      slot = (slot + 1) & (slots_.size() - 1);
    if (slots_[slot] == kUnset) {
      slots_[slot] = static_cast<std::uint32_t>(cells_.size());
      cells_.push_back(cell);
    }
    return slots_[slot];
  }
  const std::vector<Vec3i>& cells() const { return cells_; }

 private:
  std::vector<std::uint32_t> slots_;  ///< never more than half full
  std::vector<Vec3i> cells_;
};

/// Where a point lies on the lattice; nothing when it is not finite or outside the cube.
std::optional<Vec3i> cell_of(const Lattice& lattice, Vec3f p) {
  if (!is_finite(p)) return std::nullopt;
  const Vec3i cell = lattice.quantize(p);
  if (!Lattice::contains(cell)) return std::nullopt;
  return cell;
}

/// Equal for triangles with the same corners in the same winding: smallest index first.
Vec3i name_of(const Triangle& t) {
  const auto first = std::min_element(t.begin(), t.end()) - t.begin();
  return {static_cast<std::int32_t>(t[first]), static_cast<std::int32_t>(t[(first + 1) % 3]),
          static_cast<std::int32_t>(t[(first + 2) % 3])};
}

/// The triangles of a mesh by places in place of vertices, without those that lost a corner.
void add_snapped(const Mesh& mesh, const std::vector<std::uint32_t>& place_of,
                 std::vector<Triangle>& triangles, std::vector<std::uint32_t>& labels) {
  const std::vector<std::uint32_t> all = triangle_labels(mesh);
  triangles.reserve(all.size()), labels.reserve(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& [a, b, c] = mesh.triangles[i];
    const Triangle t = {place_of[a], place_of[b], place_of[c]};
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    triangles.push_back(t), labels.push_back(all[i]);
  }
}

bool indices_fit(const Mesh& mesh) {
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t)
      if (v >= mesh.positions.size()) return false;
  return true;
}

bool runs_fit(const Mesh& mesh) {
  if (!mesh.sensors.empty() && !mesh.views.empty()) return false;
  std::uint64_t next = 0;
  std::optional<std::uint32_t> last;
  for (const LabelRun& run : label_runs(mesh)) {
    if (run.first != next || run.count == 0 || (last && run.label <= *last)) return false;
    next += run.count, last = run.label;
  }
  return next == mesh.triangles.size();
}

/// Draco takes the lattice's corner as float: it must lie where floats are as fine as the lattice.
bool usable(const Lattice& lattice) {
  if (lattice.step_exp < -11 || lattice.step_exp > -9 || !is_finite(lattice.origin)) return false;
  const double step = lattice.step_m(), limit = step * (1 << 24);
  const Vec3d low = lattice.low_corner(), high = low + Vec3d{1, 1, 1} * (step * Lattice::kCells);
  for (int axis = 0; axis < 3; ++axis) {
    if (low[axis] < -limit || high[axis] > limit) return false;
    if (std::floor(low[axis] / step) * step != low[axis]) return false;
  }
  return true;
}

Status check_for_encoding(const Mesh& mesh, const Lattice& lattice) {
  if (!usable(lattice)) return invalid_chunk("the lattice's step or origin cannot be used");
  if (mesh.triangles.empty()) return Error{Error::Cause::empty, "chunk: no triangles"};
  if (mesh.triangles.size() > kMaxTriangles)
    return Error{Error::Cause::too_large, "chunk: " + std::to_string(mesh.triangles.size()) +
                                              " triangles, at most " +
                                              std::to_string(kMaxTriangles)};
  if (!indices_fit(mesh)) return invalid_chunk("a triangle names a vertex that is not there");
  if (!runs_fit(mesh))
    return invalid_chunk("runs must be of one kind, sorted by label, and cover the triangles");
  for (const Vec3f& p : mesh.positions) {
    const auto cell = cell_of(lattice, p);
    if (!cell || lattice.position(*cell) != p)
      return invalid_chunk("a vertex is not on the lattice");
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f a = mesh.corner(t, 0), b = mesh.corner(t, 1), c = mesh.corner(t, 2);
    if (a == b || b == c || c == a) return invalid_chunk("a triangle has two corners in one place");
  }
  return {};
}

/// Colours belong to background chunks: one for each vertex, and triangles that no view textures.
Status check_colors(const Chunk& chunk) {
  const bool background = chunk.key.id.source == kBackgroundSource;
  if (!background && !chunk.colors.empty()) return invalid_chunk("only a background has colours");
  if (!background) return {};
  if (chunk.colors.size() != chunk.mesh.positions.size())
    return invalid_chunk("a background needs a colour for each vertex");
  if (!chunk.mesh.sensors.empty() || !chunk.mesh.views.empty())
    return invalid_chunk("a background has no labels");
  return {};
}

/// What the labels stand for: sorted, without kNoSensor and kNoView, which sort last in the runs.
template <typename Id>
std::vector<Id> meanings_of(const std::vector<Run<Id>>& runs) {
  std::vector<Id> out;
  for (const Run<Id>& run : runs)
    if (number_of(run.id) != kNoLabel) out.push_back(run.id);
  return out;
}

draco::GeometryAttribute attribute(draco::GeometryAttribute::Type type, draco::DataType data,
                                   int components, int bytes) {
  draco::GeometryAttribute a;
  a.Init(type, nullptr, static_cast<std::uint8_t>(components), data, false, bytes, 0);
  return a;
}

struct LabelledCorners {
  std::vector<std::uint32_t> vertex;  ///< [points]
  std::vector<std::uint8_t> label;    ///< [points]
  std::vector<Triangle> faces;        ///< of points
};

/// One Draco point for each pair of a vertex and a label.
LabelledCorners split_by_label(const Mesh& mesh) {
  LabelledCorners out;
  out.faces.reserve(mesh.triangles.size());
  std::vector<std::uint32_t> point(mesh.positions.size()), used_by(mesh.positions.size(), kUnset);
  const std::vector<LabelRun> runs = label_runs(mesh);
  for (std::uint32_t r = 0; r < runs.size(); ++r) {
    const LabelRun& run = runs[r];
    const auto label = run.label == kNoLabel ? kNoViewLabel : static_cast<std::uint8_t>(r);
    for (std::uint32_t t = run.first; t < run.first + run.count; ++t) {
      Triangle face = mesh.triangles[t];
      for (std::uint32_t& v : face) {
        if (used_by[v] != r) {
          used_by[v] = r;
          point[v] = static_cast<std::uint32_t>(out.vertex.size());
          out.vertex.push_back(v);
          out.label.push_back(label);
        }
        v = point[v];
      }
      out.faces.push_back(face);
    }
  }
  return out;
}

void set_faces(draco::Mesh& out, const std::vector<Triangle>& faces) {
  out.SetNumFaces(faces.size());
  for (std::uint32_t f = 0; f < faces.size(); ++f)
    out.SetFace(draco::FaceIndex(f),
                {draco::PointIndex(faces[f][0]), draco::PointIndex(faces[f][1]),
                 draco::PointIndex(faces[f][2])});
}

struct DracoMesh {
  draco::Mesh mesh;
  int position = -1, label = -1;  ///< attribute ids; label -1: none
};

void add_colors(const std::vector<Color>& colors, draco::Mesh& out) {
  const auto color = attribute(draco::GeometryAttribute::COLOR, draco::DT_UINT8, 3, sizeof(Color));
  const int id = out.AddAttribute(color, true, static_cast<std::uint32_t>(colors.size()));
  draco::PointAttribute* values = out.attribute(id);
  for (std::uint32_t v = 0; v < colors.size(); ++v)
    values->SetAttributeValue(draco::AttributeValueIndex(v), colors[v].data());
}

void build(const Mesh& mesh, bool labelled, DracoMesh& out) {
  using draco::AttributeValueIndex;
  using draco::GeometryAttribute;
  LabelledCorners corners;
  if (labelled) corners = split_by_label(mesh);
  const auto vertices = static_cast<std::uint32_t>(mesh.positions.size());
  const auto points = labelled ? static_cast<std::uint32_t>(corners.vertex.size()) : vertices;
  out.mesh.set_num_points(points);
  set_faces(out.mesh, labelled ? corners.faces : mesh.triangles);

  const auto position = attribute(GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, sizeof(Vec3f));
  out.position = out.mesh.AddAttribute(position, !labelled, vertices);
  draco::PointAttribute* values = out.mesh.attribute(out.position);
  for (std::uint32_t v = 0; v < vertices; ++v)
    values->SetAttributeValue(AttributeValueIndex(v), &mesh.positions[v]);
  if (!labelled) return;

  const auto label = attribute(GeometryAttribute::GENERIC, draco::DT_UINT8, 1, 1);
  out.label = out.mesh.AddAttribute(label, false, 256);
  draco::PointAttribute* labels = out.mesh.attribute(out.label);
  values = out.mesh.attribute(out.position);
  for (std::uint32_t i = 0; i < 256; ++i) {
    const auto byte = static_cast<std::uint8_t>(i);
    labels->SetAttributeValue(AttributeValueIndex(i), &byte);
  }
  for (std::uint32_t p = 0; p < points; ++p) {
    values->SetPointMapEntry(draco::PointIndex(p), AttributeValueIndex(corners.vertex[p]));
    labels->SetPointMapEntry(draco::PointIndex(p), AttributeValueIndex(corners.label[p]));
  }
}

Result<std::vector<std::byte>> compress(const DracoMesh& in, const Lattice& lattice, int speed) {
  draco::ExpertEncoder encoder(in.mesh);
  const int draco_speed = std::clamp(speed, 0, 10);
  encoder.SetSpeedOptions(draco_speed, draco_speed);
  encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
  // Above speed 5 Draco would cut the mesh open along the labels, and pay for it in bytes.
  encoder.options().SetGlobalBool("split_mesh_on_seams", false);
  const Vec3f low = vec_cast<float>(lattice.low_corner());
  const float corner[3] = {low.x, low.y, low.z};
  const auto range = static_cast<float>(lattice.step_m() * (Lattice::kCells - 1));
  encoder.SetAttributeExplicitQuantization(in.position, Lattice::kBits, 3, corner, range);
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeToBuffer(&buffer);
  if (!status.ok()) return corrupt_chunk("Draco refuses to encode: " + status.error_msg_string());
  const auto* bytes = reinterpret_cast<const std::byte*>(buffer.data());
  return std::vector<std::byte>(bytes, bytes + buffer.size());
}

/// What a stream says about itself before anything is allocated for it.
struct StreamHeader {
  std::uint64_t vertices = 0, faces = 0;
  int attribute_seams = 0;  ///< attributes with connectivity of their own
};

/// Draco's bitstream 2.2, Edgebreaker, no metadata: all that our encoder writes.
std::optional<StreamHeader> read_header(std::span<const std::byte> payload) {
  constexpr unsigned char kStart[] = {'D', 'R', 'A', 'C', 'O', 2, 2, 1, 1, 0, 0};
  if (payload.size() < sizeof kStart + 4 || std::memcmp(payload.data(), kStart, sizeof kStart) != 0)
    return std::nullopt;
  std::size_t at = sizeof kStart + 1;  // one byte names the traversal
  const auto varint = [&]() -> std::optional<std::uint64_t> {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 35 && at < payload.size(); shift += 7) {
      const auto byte = static_cast<std::uint64_t>(payload[at++]);
      value |= (byte & 127) << shift;
      if (byte < 128) return value;
    }
    return std::nullopt;
  };
  const auto vertices = varint(), faces = varint();
  if (!vertices || !faces || at >= payload.size()) return std::nullopt;
  return StreamHeader{*vertices, *faces, static_cast<int>(payload[at])};
}

bool is_position(const draco::PointAttribute& a) {
  return a.attribute_type() == draco::GeometryAttribute::POSITION && a.num_components() == 3 &&
         a.data_type() == draco::DT_FLOAT32;
}
bool is_label(const draco::PointAttribute& a) {
  return a.attribute_type() == draco::GeometryAttribute::GENERIC && a.num_components() == 1 &&
         a.data_type() == draco::DT_UINT8;
}
bool is_color(const draco::PointAttribute& a) {
  return a.attribute_type() == draco::GeometryAttribute::COLOR && a.num_components() == 3 &&
         a.data_type() == draco::DT_UINT8;
}

/// Looks at what attributes a stream declares before it lets Draco make room for their values: a
/// few hundred bytes can ask for gigabytes.
class GuardedDecoder final : public draco::MeshEdgebreakerDecoder {
 public:
  explicit GuardedDecoder(bool colored) : colored_(colored) {}

 protected:
  bool DecodeAllAttributes() override {
    const draco::PointCloud& cloud = *point_cloud();
    const int count = cloud.num_attributes();
    if (count < 1 || count > 2 || !is_position(*cloud.attribute(0))) return false;
    if (colored_ && count != 2) return false;
    if (count == 2 && !(colored_ ? is_color : is_label)(*cloud.attribute(1))) return false;
    if (cloud.num_points() > 3 * std::uint64_t{mesh()->num_faces()}) return false;
    return MeshEdgebreakerDecoder::DecodeAllAttributes();
  }

 private:
  bool colored_;  ///< COLOR must be there and is no label
};

Status decompress(std::span<const std::byte> payload, bool colored, draco::Mesh& out) {
  try {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(payload.data()), payload.size());
    GuardedDecoder decoder(colored);
    const draco::Status status = decoder.Decode(draco::DecoderOptions(), &buffer, &out);
    if (!status.ok()) return corrupt_chunk("Draco refuses to decode: " + status.error_msg_string());
  } catch (const std::exception& e) {
    return corrupt_chunk(std::string("Draco gave up: ") + e.what());
  }
  return {};
}

/// The values of an attribute as bytes; nothing when they are not all there.
const std::uint8_t* values_of(const draco::PointAttribute& a, std::size_t value_bytes) {
  if (a.byte_stride() != static_cast<std::int64_t>(value_bytes) || a.byte_offset() != 0 ||
      a.buffer() == nullptr || a.buffer()->data_size() < a.size() * value_bytes)
    return nullptr;
  return a.buffer()->data();
}

/// Attribute value of each point, checked.
Result<std::vector<std::uint32_t>> value_indices(const draco::Mesh& mesh,
                                                 const draco::PointAttribute& a) {
  if (!a.is_mapping_identity() && a.indices_map_size() < mesh.num_points())
    return corrupt_chunk("points without values");
  std::vector<std::uint32_t> indices(mesh.num_points());
  for (std::uint32_t p = 0; p < mesh.num_points(); ++p) {
    indices[p] = a.mapped_index(draco::PointIndex(p)).value();
    if (indices[p] >= a.size()) return corrupt_chunk("a point names a value that is not there");
  }
  return indices;
}

Result<std::vector<Vec3i>> point_cells(const draco::Mesh& mesh, const Lattice& lattice) {
  const draco::PointAttribute& positions = *mesh.attribute(0);
  const std::uint8_t* data = values_of(positions, sizeof(Vec3f));
  if (data == nullptr) return corrupt_chunk("positions are missing");
  auto indices = value_indices(mesh, positions);
  if (!indices) return indices.error();
  std::vector<Vec3i> cells(positions.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    Vec3f p;
    std::memcpy(&p, data + i * sizeof p, sizeof p);
    const auto cell = cell_of(lattice, p);
    if (!cell || lattice.position(*cell) != p)
      return corrupt_chunk("a vertex is not on the lattice");
    cells[i] = *cell;
  }
  std::vector<Vec3i> of_points(indices->size());
  for (std::size_t p = 0; p < of_points.size(); ++p) of_points[p] = cells[(*indices)[p]];
  return of_points;
}

/// Label of each point; without labels all have the chunk's one meaning, or none.
Result<std::vector<std::uint8_t>> point_labels(const draco::Mesh& mesh, bool labelled,
                                               std::size_t meanings) {
  if (!labelled) {
    if (meanings > 1) return corrupt_chunk("labels are missing");
    return std::vector<std::uint8_t>(mesh.num_points(), meanings == 0 ? kNoViewLabel : 0);
  }
  const draco::PointAttribute& attribute = *mesh.attribute(1);
  const std::uint8_t* data = values_of(attribute, 1);
  if (data == nullptr) return corrupt_chunk("labels are missing");
  auto indices = value_indices(mesh, attribute);
  if (!indices) return indices.error();
  std::vector<std::uint8_t> labels(indices->size());
  for (std::size_t p = 0; p < labels.size(); ++p) {
    labels[p] = data[(*indices)[p]];
    if (labels[p] >= meanings && labels[p] != kNoViewLabel)
      return corrupt_chunk("label " + std::to_string(labels[p]) + " of " +
                           std::to_string(meanings));
  }
  return labels;
}

/// Colour of each point.
Result<std::vector<Color>> point_colors(const draco::Mesh& mesh) {
  const draco::PointAttribute& attribute = *mesh.attribute(1);
  const std::uint8_t* data = values_of(attribute, sizeof(Color));
  if (data == nullptr) return corrupt_chunk("colours are missing");
  auto indices = value_indices(mesh, attribute);
  if (!indices) return indices.error();
  std::vector<Color> colors(indices->size());
  for (std::size_t p = 0; p < colors.size(); ++p)
    std::memcpy(colors[p].data(), data + std::size_t{(*indices)[p]} * sizeof(Color), sizeof(Color));
  return colors;
}

/// Colours of the vertices that rebuild() makes, by the same welding.
Result<std::vector<Color>> rebuild_colors(const draco::Mesh& in, const Lattice& lattice) {
  const auto cells = point_cells(in, lattice);
  if (!cells) return cells.error();
  const auto of_points = point_colors(in);
  if (!of_points) return of_points.error();
  Welder welder(cells->size());
  std::vector<Color> colors;
  for (std::uint32_t f = 0; f < in.num_faces(); ++f)
    for (const draco::PointIndex& point : in.face(draco::FaceIndex(f))) {
      const std::uint32_t vertex = welder.index_of((*cells)[point.value()]);
      if (vertex == colors.size()) colors.push_back((*of_points)[point.value()]);
    }
  return colors;
}

/// The mesh without labels; `of_triangles` gets one for each triangle: one of `meanings`.
Result<Mesh> rebuild(const draco::Mesh& in, bool labelled,
                     const std::vector<std::uint32_t>& meanings, const Lattice& lattice,
                     std::vector<std::uint32_t>& of_triangles) {
  const auto cells = point_cells(in, lattice);
  if (!cells) return cells.error();
  const auto labels = point_labels(in, labelled, meanings.size());
  if (!labels) return labels.error();
  Welder welder(cells->size());
  Mesh mesh;
  mesh.triangles.reserve(in.num_faces());
  of_triangles.reserve(in.num_faces());
  for (std::uint32_t f = 0; f < in.num_faces(); ++f) {
    Triangle t;
    std::uint8_t label[3];
    for (int c = 0; c < 3; ++c) {
      const std::uint32_t point = in.face(draco::FaceIndex(f))[c].value();
      if (point >= cells->size())
        return corrupt_chunk("a triangle names a point that is not there");
      t[c] = welder.index_of((*cells)[point]);
      label[c] = (*labels)[point];
    }
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
      return corrupt_chunk("a triangle has two corners in one place");
    if (label[0] != label[1] || label[1] != label[2])
      return corrupt_chunk("the corners of a triangle have different labels");
    mesh.triangles.push_back(t);
    of_triangles.push_back(label[0] == kNoViewLabel ? kNoLabel : meanings[label[0]]);
  }
  mesh.positions.reserve(welder.cells().size());
  for (const Vec3i& cell : welder.cells()) mesh.positions.push_back(lattice.position(cell));
  return mesh;
}

template <typename Id>
bool are_meanings(const std::vector<Id>& ids) {
  return ids.size() <= kMaxViews && (ids.empty() || number_of(ids.back()) != kNoLabel) &&
         std::ranges::adjacent_find(ids, std::ranges::greater_equal{}) == ids.end();
}

Status check_for_decoding(const EncodedChunk& chunk, const Lattice& lattice) {
  if (!usable(lattice)) return invalid_chunk("the lattice's step or origin cannot be used");
  if (chunk.payload.size() > kMaxPayload || chunk.triangles > kMaxTriangles)
    return Error{Error::Cause::too_large, "chunk: more bytes or triangles than a chunk may have"};
  if (!std::isfinite(chunk.error_m) || chunk.error_m < 0)
    return invalid_chunk("impossible error_m");
  if (!are_meanings(chunk.sensors) || !are_meanings(chunk.views))
    return invalid_chunk("sensors and views must be sorted and unique, at most 254");
  if (!chunk.sensors.empty() && !chunk.views.empty())
    return invalid_chunk("labels mean sensors or views, not both");
  if (chunk.key.id.source == kBackgroundSource && !(chunk.sensors.empty() && chunk.views.empty()))
    return invalid_chunk("a background has no labels");
  if (!are_apart(chunk.guessed, chunk.triangles)) return invalid_chunk("impossible guesses");
  const auto header = read_header(chunk.payload);
  if (!header) return corrupt_chunk("not an Edgebreaker stream of version 2.2");
  if (header->faces == 0 || header->faces != chunk.triangles ||
      header->vertices > 3 * header->faces || header->attribute_seams > 1)
    return corrupt_chunk("the stream's size is not as promised");
  return {};
}

/// A triangle's corners, the smallest first, in the same winding.
using PlacedTriangle = std::array<Vec3f, 3>;
PlacedTriangle placed(const Mesh& mesh, std::size_t triangle) {
  PlacedTriangle out{mesh.corner(triangle, 0), mesh.corner(triangle, 1), mesh.corner(triangle, 2)};
  std::rotate(out.begin(), std::min_element(out.begin(), out.end()), out.end());
  return out;
}

/// What the labels of a chunk's stream stand for.
std::vector<std::uint32_t> meanings_of(const EncodedChunk& chunk) {
  return chunk.sensors.empty() ? numbers_of(chunk.views) : numbers_of(chunk.sensors);
}

/// Where the guessed triangles are in the coded stream: Edgebreaker has an order of its own.
Result<std::vector<TriangleRange>> guessed_in_stream(const Chunk& chunk, const EncodedChunk& coded,
                                                     const Lattice& lattice) {
  std::vector<PlacedTriangle> wanted;
  for (std::size_t t = 0; t < chunk.guessed.size(); ++t)
    if (chunk.guessed[t]) wanted.push_back(placed(chunk.mesh, t));
  std::vector<TriangleRange> out;
  if (wanted.empty()) return out;
  std::ranges::sort(wanted);
  draco::Mesh decoded;
  if (auto ok = decompress(coded.payload, false, decoded); !ok) return ok.error();
  std::vector<std::uint32_t> labels;
  const auto mesh =
      rebuild(decoded, decoded.num_attributes() > 1, meanings_of(coded), lattice, labels);
  if (!mesh) return mesh.error();
  for (std::uint32_t t = 0; t < mesh->triangles.size(); ++t) {
    if (!std::ranges::binary_search(wanted, placed(*mesh, t))) continue;
    if (out.empty() || out.back().first + out.back().count != t) out.push_back({t, 0});
    ++out.back().count;
  }
  return out;
}

/// [T] The marks of triangles in the stream's order.
std::vector<std::uint8_t> marks_of(const EncodedChunk& chunk) {
  std::vector<std::uint8_t> out;
  if (chunk.guessed.empty()) return out;
  out.resize(chunk.triangles, 0);
  for (const TriangleRange& r : chunk.guessed) std::fill_n(out.begin() + r.first, r.count, 1);
  return out;
}

/// The same once the triangles are sorted by label, as set_triangle_views() sorts them.
std::vector<std::uint8_t> sorted_by(const std::vector<std::uint32_t>& labels,
                                    const std::vector<std::uint8_t>& marks) {
  std::vector<std::uint32_t> order(marks.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::stable_sort(order, {}, [&](std::uint32_t t) { return labels[t]; });
  std::vector<std::uint8_t> out;
  out.reserve(marks.size());
  for (const std::uint32_t t : order) out.push_back(marks[t]);
  return out;
}

}  // namespace

Result<Mesh> snap_to_lattice(const Mesh& mesh, const Lattice& lattice) {
  auto snapped = snap_vertices(mesh, lattice);
  if (!snapped) return snapped.error();
  return std::move(snapped->mesh);
}

Result<Snapped> snap_vertices(const Mesh& mesh, const Lattice& lattice) {
  if (!usable(lattice)) return invalid_chunk("the lattice's step or origin cannot be used");
  if (!indices_fit(mesh)) return invalid_chunk("a triangle names a vertex that is not there");
  std::vector<Vec3i> cells(mesh.positions.size());
  for (std::size_t v = 0; v < cells.size(); ++v) {
    const auto cell = cell_of(lattice, mesh.positions[v]);
    if (!cell)
      return invalid_chunk("vertex " + std::to_string(v) + " is not finite or outside the lattice");
    cells[v] = *cell;
  }
  Welder places(cells.size()), kept(mesh.triangles.size());
  std::vector<std::uint32_t> place_of(cells.size());
  for (std::size_t v = 0; v < cells.size(); ++v) place_of[v] = places.index_of(cells[v]);
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> labels;
  add_snapped(mesh, place_of, triangles, labels);
  turn_flat_edges(places.cells(), triangles, labels);

  Snapped snapped{{}, std::vector<std::uint32_t>(cells.size(), Snapped::kGone)};
  Mesh& out = snapped.mesh;
  std::vector<std::uint32_t> vertex_of(places.cells().size(), Snapped::kGone);
  std::vector<std::uint32_t> kept_labels;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    Triangle t = triangles[i];
    if (is_flat(places.cells(), t)) continue;
    for (std::uint32_t& v : t) {
      if (vertex_of[v] == Snapped::kGone) {
        vertex_of[v] = static_cast<std::uint32_t>(out.positions.size());
        out.positions.push_back(lattice.position(places.cells()[v]));
      }
      v = vertex_of[v];
    }
    if (kept.index_of(name_of(t)) < out.triangles.size()) continue;  // there already
    out.triangles.push_back(t);
    kept_labels.push_back(labels[i]);
  }
  for (std::size_t v = 0; v < cells.size(); ++v) snapped.vertex_of[v] = vertex_of[place_of[v]];
  if (!mesh.sensors.empty()) set_triangle_sensors(out, ids_of<SensorId>(kept_labels));
  if (!mesh.views.empty()) set_triangle_views(out, ids_of<ViewId>(kept_labels));
  return snapped;
}

Result<EncodedChunk> encode_chunk(const Chunk& chunk, const Lattice& lattice, int speed) {
  if (auto ok = check_for_encoding(chunk.mesh, lattice); !ok) return ok.error();
  if (auto ok = check_colors(chunk); !ok) return ok.error();
  if (!chunk.guessed.empty() && chunk.guessed.size() != chunk.mesh.triangles.size())
    return invalid_chunk("marks of guesses must be one for each triangle");
  EncodedChunk out;
  out.key = chunk.key;
  out.error_m = chunk.error_m;
  out.triangles = static_cast<std::uint32_t>(chunk.mesh.triangles.size());
  out.sensors = meanings_of(chunk.mesh.sensors);
  out.views = meanings_of(chunk.mesh.views);
  if (const std::size_t labels = out.sensors.size() + out.views.size(); labels > kMaxViews)
    return invalid_chunk(std::to_string(labels) + " labels, at most 254");
  try {
    DracoMesh mesh;
    build(chunk.mesh, label_runs(chunk.mesh).size() > 1, mesh);
    if (!chunk.colors.empty()) add_colors(chunk.colors, mesh.mesh);
    auto payload = compress(mesh, lattice, speed);
    if (!payload) return payload.error();
    out.payload = std::move(*payload);
    auto guessed = guessed_in_stream(chunk, out, lattice);
    if (!guessed) return guessed.error();
    out.guessed = *std::move(guessed);
  } catch (const std::exception& e) {
    return corrupt_chunk(std::string("Draco gave up: ") + e.what());
  }
  return out;
}

Result<Chunk> decode_chunk(const EncodedChunk& chunk, const Lattice& lattice) {
  if (auto ok = check_for_decoding(chunk, lattice); !ok) return ok.error();
  const bool colored = chunk.key.id.source == kBackgroundSource;
  draco::Mesh decoded;
  if (auto ok = decompress(chunk.payload, colored, decoded); !ok) return ok.error();
  if (decoded.num_faces() != chunk.triangles || decoded.num_attributes() < 1)
    return corrupt_chunk("the stream's size is not as promised");
  const bool labelled = !colored && decoded.num_attributes() > 1;
  const bool by_sensor = !chunk.sensors.empty();
  std::vector<std::uint32_t> labels;
  auto mesh = rebuild(decoded, labelled, meanings_of(chunk), lattice, labels);
  if (!mesh) return mesh.error();
  if (by_sensor) set_triangle_sensors(*mesh, ids_of<SensorId>(labels));
  if (!chunk.views.empty()) set_triangle_views(*mesh, ids_of<ViewId>(labels));
  Chunk out{chunk.key, chunk.error_m, std::move(*mesh), sorted_by(labels, marks_of(chunk))};
  if (!colored) return out;
  auto colors = rebuild_colors(decoded, lattice);
  if (!colors) return colors.error();
  out.colors = std::move(*colors);
  return out;
}

}  // namespace mr::codec
