#pragma once

#include <cstdint>

namespace mr {

/// A scene has two surfaces (docs/layers.md): the moving surface, reconstructed from every capture,
/// and the still surface, kept until it changes. In a scene without layers everything is `moving`.
enum class Layer : std::uint8_t { moving, still };

}  // namespace mr
