#include "mr/yaml/flow_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

namespace mr::yaml {
namespace {

std::vector<double> in_degrees(const std::vector<double>& angles_rad) {
  std::vector<double> out;
  for (const double angle : angles_rad) out.push_back(angle * 180 / std::numbers::pi);
  return out;
}

std::string lens_text(const Camera& camera) {
  if (camera.distortion == DistortionModel::none) return {};
  constexpr const char* kModels[] = {"none", "brown", "rational", "rational_6kt"};
  const bool is_brown = camera.distortion == DistortionModel::brown;
  std::string out = std::string(", distortion: {model: ") +
                    kModels[static_cast<int>(camera.distortion)] +
                    ", k: " + list_text(std::span(camera.k).first(is_brown ? 3 : 6)) +
                    ", p: " + list_text(camera.p);
  if (camera.most_radius > 0) out += ", most_radius: " + exact_text(camera.most_radius);
  return out + "}";
}

class FlowWriter {
 public:
  FlowWriter(int column, int indent, const std::function<void(Node&)>& change)
      : column_(static_cast<std::size_t>(column)), indent_(indent), change_(change) {}

  void write(Node& node, const std::string& before, const std::string& after) {
    switch (node.kind) {
      case Node::Kind::null:
        return put(before + "null" + after);
      case Node::Kind::scalar:
        change_(node);
        return put(before + (node.quoted ? quoted_text(node.text) : node.text) + after);
      case Node::Kind::list:
      case Node::Kind::map:
        return write_entries(node, before, after);
    }
  }

  std::string text;

 private:
  void write_entries(Node& node, const std::string& before, const std::string& after) {
    const bool is_map = node.kind == Node::Kind::map;
    const std::string open = before + (is_map ? "{" : "["), close = (is_map ? "}" : "]") + after;
    if (node.items.empty()) return put(open + close);
    for (std::size_t i = 0; i < node.items.size(); ++i) {
      const bool is_last = i + 1 == node.items.size();
      write(node.items[i], (i == 0 ? open : "") + (is_map ? node.keys[i].name + ": " : ""),
            is_last ? close : ",");
    }
  }

  /// A piece that is not wrapped inside.
  void put(const std::string& piece) {
    constexpr std::size_t kWidth = 100;
    if (!text.empty() && column_ + 1 + piece.size() > kWidth) {
      text += "\n" + std::string(static_cast<std::size_t>(indent_), ' ');
      column_ = static_cast<std::size_t>(indent_);
    } else if (!text.empty()) {
      text += ' ', ++column_;
    }
    text += piece, column_ += piece.size();
  }

  std::size_t column_;
  const int indent_;
  const std::function<void(Node&)>& change_;
};

}  // namespace

std::string exact_text(double value) {
  std::array<char, 40> text{};
  const double size = std::abs(value);
  const bool is_plain = size == 0 || (size >= 1e-6 && size < 1e15);  // 0.0002, not 2e-04
  const auto format = is_plain ? std::chars_format::fixed : std::chars_format::general;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value, format).ptr};
}

std::string list_text(std::span<const double> values) {
  std::string out = "[";
  for (const double v : values) out += (out.size() == 1 ? "" : ", ") + exact_text(v);
  return out + "]";
}

std::string quoted_text(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) >= 0x20) {
      out += c;
      continue;
    }
    std::array<char, 8> escaped{};
    std::snprintf(escaped.data(), escaped.size(), "\\x%02X", static_cast<unsigned>(c) & 0xFFu);
    out += escaped.data();
  }
  return out + "\"";
}

std::string camera_text(const Camera& camera) {
  const std::string size =
      "size: [" + std::to_string(camera.width) + ", " + std::to_string(camera.height) + "]";
  if (camera.model == CameraModel::equirectangular) return "{model: equirectangular, " + size + "}";
  if (camera.model == CameraModel::lidar) {
    const bool has_offsets =
        std::ranges::any_of(camera.beam_azimuth_rad, [](double azimuth) { return azimuth != 0; });
    return "{model: lidar, " + size +
           ", beam_altitude_deg: " + list_text(in_degrees(camera.beam_altitude_rad)) +
           (has_offsets ? ", beam_azimuth_deg: " + list_text(in_degrees(camera.beam_azimuth_rad))
                        : "") +
           "}";
  }
  return "{model: pinhole, " + size + ", fx: " + exact_text(camera.fx) +
         ", fy: " + exact_text(camera.fy) + ", cx: " + exact_text(camera.cx) +
         ", cy: " + exact_text(camera.cy) + lens_text(camera) + "}";
}

std::string flow_text(Node node, int column, int indent,
                      const std::function<void(Node& scalar)>& change) {
  FlowWriter writer(column, indent, change);
  writer.write(node, "", "");
  return writer.text;
}

}  // namespace mr::yaml
