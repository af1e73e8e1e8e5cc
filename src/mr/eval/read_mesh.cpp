#include "mr/eval/read_mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mr/core/file.h"
#include "mr/core/pose.h"

namespace mr::eval {
namespace {

static_assert(std::endian::native == std::endian::little);

enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

std::optional<Type> type_of(std::string_view name) {
  constexpr std::pair<std::string_view, Type> kTypes[] = {
      {"char", Type::int8},      {"int8", Type::int8},       {"uchar", Type::uint8},
      {"uint8", Type::uint8},    {"short", Type::int16},     {"int16", Type::int16},
      {"ushort", Type::uint16},  {"uint16", Type::uint16},   {"int", Type::int32},
      {"int32", Type::int32},    {"uint", Type::uint32},     {"uint32", Type::uint32},
      {"float", Type::float32},  {"float32", Type::float32}, {"double", Type::float64},
      {"float64", Type::float64}};
  for (const auto& [known, type] : kTypes)
    if (known == name) return type;
  return std::nullopt;
}

bool is_integer(Type type) { return type < Type::float32; }

std::size_t size_of(Type type) {
  constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<int>(type)];
}

struct Property {
  std::string name;
  Type type = Type::float32;
  std::optional<Type> count;  ///< of a list: the type of its length
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

Error corrupt_mesh(const std::string& what) { return {Error::Cause::corrupt, what}; }
Error unsupported(const std::string& what) { return {Error::Cause::unsupported, what}; }

/// A word of the header in a form that is safe for messages.
std::string shown(std::string word) {
  constexpr std::size_t kLongest = 32;
  if (word.size() > kLongest) word.resize(kLongest);
  for (char& c : word)
    if (c < ' ' || c > '~') c = '?';
  return "'" + word + "'";
}

/// The words of a header line.
std::vector<std::string> words_of(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

Result<Element> read_element(const std::vector<std::string>& words) {
  Element element;
  if (words.size() != 3) return corrupt_mesh("a header line 'element' without name and count");
  element.name = words[1];
  const char* end = words[2].data() + words[2].size();
  const auto [at, failed] = std::from_chars(words[2].data(), end, element.count);
  if (failed != std::errc{} || at != end)
    return corrupt_mesh("element " + shown(words[1]) + " has no count but " + shown(words[2]));
  return element;
}

Result<Property> read_property(const std::vector<std::string>& words) {
  const bool list = words.size() == 5 && words[1] == "list";
  if (!list && words.size() != 3) return corrupt_mesh("a header line 'property' that is none");
  const auto type = type_of(words[words.size() - 2]);
  const auto count = list ? type_of(words[2]) : std::nullopt;
  if (!type || (list && (!count || !is_integer(*count))))
    return corrupt_mesh("property " + shown(words.back()) + " is of no known type");
  return Property{words.back(), *type, count};
}

/// What a file holds, in order, and how it was turned when it was written.
struct Header {
  std::vector<Element> elements;
  std::optional<Pose> T_file_world;
};

/// The pose in a comment of an exported file (model/export.h).
Result<Pose> read_file_pose(const std::vector<std::string>& words) {
  std::array<double, 16> matrix{};
  if (words.size() != 2 + matrix.size()) return corrupt_mesh("its T_file_world has no 16 numbers");
  for (std::size_t i = 0; i < matrix.size(); ++i) {
    const std::string& word = words[2 + i];
    const char* end = word.data() + word.size();
    const auto [at, failed] = std::from_chars(word.data(), end, matrix[i]);
    if (failed != std::errc{} || at != end)
      return corrupt_mesh("its T_file_world holds " + shown(word) + ", which is no number");
  }
  auto pose = pose_from_matrix(matrix);
  if (!pose) return corrupt_mesh("its T_file_world: " + pose.error().message);
  return pose;
}

/// Takes one line of the header.
Status take_line(const std::vector<std::string>& words, Header& header) {
  if (words.size() > 1 && words[0] == "comment" && words[1] == "T_file_world") {
    auto pose = read_file_pose(words);
    if (!pose) return pose.error();
    header.T_file_world = *pose;
    return {};
  }
  if (words.empty() || words[0] == "comment" || words[0] == "obj_info") return {};
  if (words[0] == "format") {
    if (words.size() == 3 && words[1] == "binary_little_endian") return {};
    return unsupported("only binary little-endian PLY is read, not " +
                       shown(words.size() > 1 ? words[1] : ""));
  }
  if (words[0] == "element") {
    auto element = read_element(words);
    if (!element) return element.error();
    header.elements.push_back(*std::move(element));
    return {};
  }
  if (words[0] != "property" || header.elements.empty())
    return corrupt_mesh("a header line begins with " + shown(words[0]));
  auto property = read_property(words);
  if (!property) return property.error();
  header.elements.back().properties.push_back(*std::move(property));
  return {};
}

/// Reads the header and takes it off the text.
Result<Header> read_header(std::string_view& text) {
  constexpr std::size_t kLongest = 1 << 16;
  if (!text.starts_with("ply\n") && !text.starts_with("ply\r\n"))
    return corrupt_mesh("it does not begin with 'ply'");
  Header header;
  bool format = false;
  for (std::size_t at = text.find('\n') + 1; at < kLongest;) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string_view::npos) break;
    const auto words = words_of(std::string(text.substr(at, std::min(end - at, kLongest))));
    at = end + 1;
    if (words.size() == 1 && words[0] == "end_header") {
      if (!format) return corrupt_mesh("its header names no format");
      text.remove_prefix(at);
      return header;
    }
    format |= !words.empty() && words[0] == "format";
    if (const Status taken = take_line(words, header); !taken) return taken.error();
  }
  return corrupt_mesh("its header does not end");
}

/// Reads values one after another; what lies beyond the end reads as 0 and is remembered.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : left_(bytes) {}

  bool ended() const { return ended_; }
  std::size_t left() const { return left_.size(); }

  void skip(std::uint64_t count) {
    if (count > left_.size()) return end();
    left_.remove_prefix(static_cast<std::size_t>(count));
  }

  std::int64_t integer(Type type) {
    switch (type) {
      case Type::int8:
        return take<std::int8_t>();
      case Type::uint8:
        return take<std::uint8_t>();
      case Type::int16:
        return take<std::int16_t>();
      case Type::uint16:
        return take<std::uint16_t>();
      case Type::int32:
        return take<std::int32_t>();
      default:
        return take<std::uint32_t>();
    }
  }

  float number() { return take<float>(); }

 private:
  template <typename T>
  T take() {
    T value{};
    if (left_.size() < sizeof(T)) {
      end();
      return value;
    }
    std::memcpy(&value, left_.data(), sizeof(T));
    left_.remove_prefix(sizeof(T));
    return value;
  }

  void end() { left_ = {}, ended_ = true; }

  std::string_view left_;
  bool ended_ = false;
};

void skip(Reader& reader, const Property& property) {
  std::uint64_t items = 1;
  if (property.count) {
    const std::int64_t count = reader.integer(*property.count);
    items = count < 0 ? UINT32_MAX : static_cast<std::uint64_t>(count);
  }
  reader.skip(items * size_of(property.type));
}

Error cut_off(const Element& element, std::uint64_t item) {
  return corrupt_mesh("it is cut off at " + shown(element.name) + " " + std::to_string(item) +
                      " of " + std::to_string(element.count));
}

Status read_vertices(const Element& element, Reader& reader, Mesh& mesh) {
  std::vector<int> axis;  // per property; -1: none
  for (const Property& property : element.properties) {
    const bool is_axis = property.name.size() == 1 && property.name >= "x" && property.name <= "z";
    if (is_axis && (property.count || property.type != Type::float32))
      return unsupported("vertices' " + property.name + " is not of type float");
    axis.push_back(is_axis ? property.name[0] - 'x' : -1);
  }
  for (int a = 0; a < 3; ++a)
    if (std::ranges::count(axis, a) != 1) return corrupt_mesh("vertices have no float x, y and z");
  // A vertex takes 12 bytes at least.
  if (element.count > reader.left() / 12) return cut_off(element, reader.left() / 12);
  mesh.positions.resize(static_cast<std::size_t>(element.count));
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    for (std::size_t i = 0; i < axis.size(); ++i)
      if (axis[i] < 0)
        skip(reader, element.properties[i]);
      else
        mesh.positions[v][axis[i]] = reader.number();
    if (reader.ended()) return cut_off(element, v);
    if (!is_finite(mesh.positions[v]))
      return corrupt_mesh("vertex " + std::to_string(v) + " is not at a finite place");
  }
  return {};
}

/// Reads one face's list of corners.
Status read_face(const Property& list, std::uint64_t face, Reader& reader, Mesh& mesh) {
  const std::int64_t corners = reader.integer(*list.count);
  if (reader.ended()) return {};  // the caller reports it
  const std::string name = "face " + std::to_string(face);
  if (corners < 3) return corrupt_mesh(name + " has " + std::to_string(corners) + " corners");
  Triangle triangle{};
  for (std::int64_t i = 0; i < corners && !reader.ended(); ++i) {
    const std::int64_t v = reader.integer(list.type);
    if (v < 0 || v >= static_cast<std::int64_t>(mesh.positions.size()))
      return reader.ended() ? Status{}
                            : corrupt_mesh(name + " names vertex " + std::to_string(v) + " of " +
                                           std::to_string(mesh.positions.size()));
    if (i > 2) triangle[1] = triangle[2];
    triangle[static_cast<std::size_t>(std::min<std::int64_t>(i, 2))] =
        static_cast<std::uint32_t>(v);
    if (i >= 2) mesh.triangles.push_back(triangle);
  }
  return {};
}

Status read_faces(const Element& element, Reader& reader, Mesh& mesh) {
  const auto is_corners = [](const Property& p) {
    return p.name == "vertex_indices" || p.name == "vertex_index";
  };
  const auto list = std::ranges::find_if(element.properties, is_corners);
  if (list == element.properties.end() || !list->count || !is_integer(list->type))
    return corrupt_mesh("faces have no list of vertex indices");
  if (element.count > reader.left()) return cut_off(element, reader.left());
  mesh.triangles.reserve(static_cast<std::size_t>(
      std::min<std::uint64_t>(element.count, reader.left() / (3 * size_of(list->type)))));
  for (std::uint64_t f = 0; f < element.count; ++f) {
    for (const Property& property : element.properties)
      if (&property != &*list)
        skip(reader, property);
      else if (const Status read = read_face(property, f, reader, mesh); !read)
        return read;
    if (reader.ended()) return cut_off(element, f);
  }
  return {};
}

Status skip_element(const Element& element, Reader& reader) {
  if (element.properties.empty()) return {};
  for (std::uint64_t i = 0; i < element.count; ++i) {
    for (const Property& property : element.properties) skip(reader, property);
    if (reader.ended()) return cut_off(element, i);
  }
  return {};
}

Result<Mesh> parse(std::string_view text) {
  const auto header = read_header(text);
  if (!header) return header.error();
  Reader reader(text);
  Mesh mesh;
  bool vertices = false, faces = false;
  for (const Element& element : header->elements) {
    const bool again = element.name == "vertex" ? std::exchange(vertices, true)
                       : element.name == "face" ? std::exchange(faces, true)
                                                : false;
    if (again) return corrupt_mesh("it has two elements '" + element.name + "'");
    if (faces && !vertices) return unsupported("its faces come before its vertices");
    const Status read = element.name == "vertex" ? read_vertices(element, reader, mesh)
                        : element.name == "face" ? read_faces(element, reader, mesh)
                                                 : skip_element(element, reader);
    if (!read) return read.error();
  }
  if (!vertices || !faces) return corrupt_mesh("it has no vertices and faces");
  if (header->T_file_world) {
    const Pose T_world_file = header->T_file_world->inverse();
    for (Vec3f& p : mesh.positions) p = vec_cast<float>(T_world_file * vec_cast<double>(p));
  }
  return mesh;
}

}  // namespace

Result<Mesh> read_ply(const std::filesystem::path& file) {
  const auto bytes = read_file(file);
  if (!bytes) return bytes.error();
  auto mesh = parse({reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  if (!mesh) return Error{mesh.error().cause, file.string() + ": " + mesh.error().message};
  return mesh;
}

}  // namespace mr::eval
