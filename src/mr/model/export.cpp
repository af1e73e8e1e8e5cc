#include "mr/model/export.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string>
#include <system_error>

#include "mr/core/file.h"
#include "mr/model/writers.h"

namespace mr::model {
namespace {

std::string ending(const std::filesystem::path& file) {
  std::string out = file.extension().string();
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

/// Writing into a folder that is not there is io here: nothing was looked for.
Status write(const std::filesystem::path& file, const Bytes& bytes) {
  if (auto ok = write_file(file, bytes); !ok) return Error{Error::Cause::io, ok.error().message};
  return {};
}

Status write(const std::filesystem::path& file, const Result<Bytes>& bytes) {
  if (!bytes) return bytes.error();
  return write(file, *bytes);
}

/// All of them or none: the last carries the name that was asked for.
Status write_all(const std::filesystem::path& file, const std::vector<NamedBytes>& files) {
  for (std::size_t i = 0; i < files.size(); ++i) {
    const bool last = i + 1 == files.size();
    auto ok = write(last ? file : file.parent_path() / files[i].name, files[i].bytes);
    if (ok) continue;
    std::error_code ignored;
    for (std::size_t k = 0; k < i; ++k)
      std::filesystem::remove(file.parent_path() / files[k].name, ignored);
    return ok;
  }
  return {};
}

void turn(std::vector<BakedPart>& parts, const Pose& T) {
  for (BakedPart& part : parts)
    for (Vec3f& p : part.positions) p = vec_cast<float>(T * vec_cast<double>(p));
}

}  // namespace

/// Rodrigues' formula without angles, exact where `up` is an axis.
Pose T_file_world(Vec3d up) {
  const Vec3d y{0, 1, 0}, axis = cross(up, y);  // its length: the sine of the angle
  const double more = dot(up + y, up + y) / 2;  // 1 + its cosine
  if (length(up + y) < 1e-6) return Pose{{{1, 0, 0, 0, -1, 0, 0, 0, -1}}, {}};  // about x
  Pose T;
  for (int column = 0; column < 3; ++column) {
    Vec3d unit;
    unit[column] = 1;
    const Vec3d once = cross(axis, unit), twice = cross(axis, once);
    const Vec3d turned = unit + once + twice / more;
    for (int row = 0; row < 3; ++row) T.rotation(row, column) = turned[row];
  }
  return T;
}

Status export_scene(const DecodedScene& scene, Vec3d up, const std::filesystem::path& file) {
  const std::string kind = ending(file);
  if (kind != ".glb" && kind != ".ply" && kind != ".obj")
    return Error{Error::Cause::unsupported,
                 "cannot export " + file.string() + ": the name must end in .glb, .ply or .obj"};
  if (!is_finite(up) || std::abs(length(up) - 1) > 1e-3)
    return Error{Error::Cause::invalid, "export needs an up direction of unit length"};
  auto parts = bake(scene);
  if (!parts)
    return Error{parts.error().cause,
                 "cannot export " + file.string() + ": " + parts.error().message};
  const Pictures pictures = shown_textures(scene);
  if (kind == ".glb") return write(file, to_glb(*parts, pictures, normalized(up)));
  const Pose T = T_file_world(normalized(up));
  turn(*parts, T);
  if (kind == ".ply") return write(file, to_ply(*parts, pictures, T));
  const auto files = to_obj(*parts, pictures, file.stem().string());
  if (!files) return files.error();
  return write_all(file, *files);
}

}  // namespace mr::model
