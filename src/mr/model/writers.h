#pragma once

#include <array>
#include <bit>
#include <charconv>
#include <cstddef>
#include <filesystem>
#include <string>
#include <type_traits>
#include <vector>

#include "mr/core/pose.h"
#include "mr/model/bake.h"

/// The file formats of export.h, each from baked parts; private to the module.
namespace mr::model {

/// Colour of what has no texture.
inline constexpr std::array<std::uint8_t, 3> kNeutralColor{176, 176, 176};

using Bytes = std::vector<std::byte>;

/// `parts`: not empty. `pictures`: of their streams. `up`: unit length.
Result<Bytes> to_glb(const std::vector<BakedPart>& parts, const Pictures& pictures, Vec3d up);

/// `parts`: already transformed by T_file_world, which is stored in the header.
Result<Bytes> to_ply(const std::vector<BakedPart>& parts, const Pictures& pictures,
                     const Pose& T_file_world);

/// Adds the shortest text that reads back as the same number, in any locale.
template <typename Number>
void put_number(std::string& out, Number value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof(text), value).ptr;
  out.append(text, end);
}

/// A file that belongs to an export.
struct NamedBytes {
  std::filesystem::path name;  ///< without folder
  Bytes bytes;
};

/// The pictures, NAME.mtl, and NAME.obj last. White space in `name` becomes '_' inside the names of
/// pictures and materials, which OBJ readers split at blanks.
Result<std::vector<NamedBytes>> to_obj(const std::vector<BakedPart>& parts,
                                       const Pictures& pictures, const std::string& name);

/// Adds a plain value's bytes in the machine's order, which is little-endian.
template <typename T>
void put(Bytes& out, const T& value) {
  static_assert(std::is_trivially_copyable_v<T> && std::endian::native == std::endian::little);
  const auto* first = reinterpret_cast<const std::byte*>(&value);
  out.insert(out.end(), first, first + sizeof(T));
}

inline void put_text(Bytes& out, const std::string& text) {
  const auto* first = reinterpret_cast<const std::byte*>(text.data());
  out.insert(out.end(), first, first + text.size());
}

}  // namespace mr::model
