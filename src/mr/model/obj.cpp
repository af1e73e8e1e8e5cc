#include <algorithm>
#include <cstdint>

#include "mr/kit/image_io.h"
#include "mr/model/writers.h"

namespace mr::model {
namespace {

std::string without_blanks(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c <= ' '; }, '_');
  return name;
}

std::string material_name(const BakedPart& part) {
  if (part.stream) return "stream_" + std::to_string(number_of(*part.stream));
  return part.colors.empty() ? "no_view" : "background";
}

void put_part(std::string& out, const BakedPart& part, std::uint64_t first_vertex,
              std::uint64_t first_uv) {
  out += "usemtl " + material_name(part) + "\n";
  for (const Vec3f p : part.positions) {
    out += "v";
    for (int i = 0; i < 3; ++i) out += ' ', put_number(out, p[i]);
    out += '\n';
  }
  for (const Vec2f uv : part.uvs) {
    out += "vt ", put_number(out, uv.x);
    out += ' ', put_number(out, 1 - uv.y);  // OBJ counts v from the bottom
    out += '\n';
  }
  for (const Triangle& triangle : part.triangles) {
    out += "f";
    for (const std::uint32_t vertex : triangle) {
      out += ' ', put_number(out, first_vertex + vertex);
      if (part.stream) out += '/', put_number(out, first_uv + vertex);
    }
    out += '\n';
  }
}

NamedBytes named(std::string name, const std::string& text) {
  NamedBytes file{std::move(name), {}};
  put_text(file.bytes, text);
  return file;
}

}  // namespace

Result<std::vector<NamedBytes>> to_obj(const std::vector<BakedPart>& parts,
                                       const Pictures& pictures, const std::string& name) {
  const std::string stem = without_blanks(name);
  std::vector<NamedBytes> files;
  std::string materials = "# MeshReduce\n";
  std::string model = "# MeshReduce\nmtllib " + stem + ".mtl\n";
  std::uint64_t next_vertex = 1, next_uv = 1;
  for (const BakedPart& part : parts) {
    materials += "newmtl " + material_name(part) + "\nillum 0\nKa 0 0 0\n";
    if (part.stream) {
      const std::string picture = stem + "_" + std::to_string(number_of(*part.stream)) + ".png";
      auto png = kit::encode_png(*pictures.at(*part.stream));
      if (!png) return png.error();
      files.push_back({picture, std::move(*png)});
      materials += "Kd 1 1 1\nmap_Kd " + picture + "\n";
    } else {
      materials += "Kd";
      for (const std::uint8_t c : kNeutralColor) materials += " " + std::to_string(c / 255.0);
      materials += "\n";
    }
    put_part(model, part, next_vertex, next_uv);
    next_vertex += part.positions.size(), next_uv += part.uvs.size();
  }
  files.push_back(named(stem + ".mtl", materials));
  files.push_back(named(name + ".obj", model));
  return files;
}

}  // namespace mr::model
