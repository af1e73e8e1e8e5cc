#include "mr/baseline/ply_points.h"

#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <sstream>
#include <string_view>

namespace mr::baseline {
namespace {

enum class Kind { f32, f64, i8, u8, i16, u16, i32, u32 };

constexpr int kSizes[] = {4, 8, 1, 1, 2, 2, 4, 4};

std::optional<Kind> kind_of(const std::string& name) {
  static const std::map<std::string, Kind> kNames = {
      {"float", Kind::f32}, {"float32", Kind::f32}, {"double", Kind::f64}, {"float64", Kind::f64},
      {"char", Kind::i8},   {"int8", Kind::i8},     {"uchar", Kind::u8},   {"uint8", Kind::u8},
      {"short", Kind::i16}, {"int16", Kind::i16},   {"ushort", Kind::u16}, {"uint16", Kind::u16},
      {"int", Kind::i32},   {"int32", Kind::i32},   {"uint", Kind::u32},   {"uint32", Kind::u32}};
  const auto found = kNames.find(name);
  return found == kNames.end() ? std::nullopt : std::optional(found->second);
}

template <typename T>
double number_at(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return static_cast<double>(value);
}

double number_at(Kind kind, const std::byte* at) {
  switch (kind) {
    case Kind::f32:
      return number_at<float>(at);
    case Kind::f64:
      return number_at<double>(at);
    case Kind::i8:
      return number_at<std::int8_t>(at);
    case Kind::u8:
      return number_at<std::uint8_t>(at);
    case Kind::i16:
      return number_at<std::int16_t>(at);
    case Kind::u16:
      return number_at<std::uint16_t>(at);
    case Kind::i32:
      return number_at<std::int32_t>(at);
    default:
      return number_at<std::uint32_t>(at);
  }
}

constexpr const char* kWanted[] = {"x", "y", "z", "red", "green", "blue"};

struct Header {
  bool ascii = false;
  std::uint64_t vertices = 0;
  std::vector<Kind> properties;  ///< of a vertex
  int place[6];                  ///< of kWanted among them
  std::size_t bytes = 0;         ///< of the header itself
};

/// Takes one line of the header in; false when it cannot be read.
bool read_line(const std::string& line, std::string& element, std::vector<std::string>& names,
               Header& header) {
  std::istringstream words(line);
  std::string word, type, name;
  words >> word;
  if (word == "format") {
    words >> type;
    header.ascii = type == "ascii";
    return header.ascii || type == "binary_little_endian";
  }
  if (word == "element") {
    words >> element;
    if (element != "vertex") return !names.empty();  // vertices come first
    return static_cast<bool>(words >> header.vertices);
  }
  if (word != "property" || element != "vertex") return true;
  words >> type >> name;
  const auto kind = kind_of(type);
  if (!kind) return false;
  header.properties.push_back(*kind);
  names.push_back(name);
  return true;
}

std::optional<Header> read_header(std::string_view text) {
  constexpr std::size_t kLongest = 1u << 16;
  Header header;
  std::string element;
  std::vector<std::string> names;
  bool first = true;
  for (std::size_t at = 0; at < std::min(text.size(), kLongest);) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string_view::npos) return std::nullopt;
    std::string line(text.substr(at, end - at));
    if (!line.empty() && line.back() == '\r') line.pop_back();
    at = end + 1;
    if (std::exchange(first, false) && line != "ply") return std::nullopt;
    if (line == "end_header") {
      header.bytes = at;
      for (int i = 0; i < 6; ++i) {
        const auto found = std::find(names.begin(), names.end(), kWanted[i]);
        if (found == names.end()) return std::nullopt;
        header.place[i] = static_cast<int>(found - names.begin());
      }
      return header;
    }
    if (!read_line(line, element, names, header)) return std::nullopt;
  }
  return std::nullopt;
}

/// Reads one vertex after another.
class VertexReader {
 public:
  VertexReader(const Header& header, std::span<const std::byte> bytes)
      : header_(header), rest_(bytes), values_(header.properties.size()) {}

  bool next() { return header_.ascii ? next_ascii() : next_binary(); }
  double value(int wanted) const { return values_[header_.place[wanted]]; }

 private:
  bool next_binary() {
    for (std::size_t i = 0; i < values_.size(); ++i) {
      const auto size = static_cast<std::size_t>(kSizes[static_cast<int>(header_.properties[i])]);
      if (rest_.size() < size) return false;
      values_[i] = number_at(header_.properties[i], rest_.data());
      rest_ = rest_.subspan(size);
    }
    return true;
  }
  bool next_ascii() {
    for (double& value : values_) {
      const char* at = reinterpret_cast<const char*>(rest_.data());
      const char* const end = at + rest_.size();
      while (at < end && (*at == ' ' || *at == '\n' || *at == '\r' || *at == '\t')) ++at;
      const auto [after, error] = std::from_chars(at, end, value);
      if (error != std::errc()) return false;
      rest_ = rest_.last(static_cast<std::size_t>(end - after));
    }
    return true;
  }

  const Header& header_;
  std::span<const std::byte> rest_;
  std::vector<double> values_;
};

}  // namespace

Bytes to_ply(const PointSet& points) {
  const std::string head =
      "ply\nformat binary_little_endian 1.0\nelement vertex " +
      std::to_string(points.positions.size()) +
      "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
      "property uchar green\nproperty uchar blue\nend_header\n";
  const auto text = std::as_bytes(std::span(head));
  Bytes out(text.begin(), text.end());
  out.reserve(out.size() + 15 * points.positions.size());
  for (std::size_t i = 0; i < points.positions.size(); ++i) {
    const auto position = std::as_bytes(std::span(&points.positions[i], 1));
    const auto color = std::as_bytes(std::span(points.colors[i]));
    out.insert(out.end(), position.begin(), position.end());
    out.insert(out.end(), color.begin(), color.end());
  }
  return out;
}

Result<PointSet> from_ply(std::span<const std::byte> bytes, std::uint32_t most) {
  const auto header = read_header({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (!header) return corrupt("no .ply file of coloured points");
  if (header->vertices > most)
    return Error{Error::Cause::too_large, "baseline: a .ply file of too many points"};
  PointSet out;
  VertexReader reader(*header, bytes.subspan(header->bytes));
  for (std::uint64_t i = 0; i < header->vertices; ++i) {
    if (!reader.next()) return corrupt("a .ply file that ends early");
    const Vec3d p{reader.value(0), reader.value(1), reader.value(2)};
    const Vec3d shade{reader.value(3), reader.value(4), reader.value(5)};
    if (!is_finite(p) || !is_finite(shade))
      return corrupt("a .ply file with a point that is nowhere");
    out.positions.push_back(vec_cast<float>(p));
    auto& color = out.colors.emplace_back();
    for (int c = 0; c < 3; ++c)
      color[c] = static_cast<std::uint8_t>(std::clamp(std::round(shade[c]), 0.0, 255.0));
  }
  return out;
}

}  // namespace mr::baseline
