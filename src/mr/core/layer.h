#pragma once

#include <cstdint>

namespace mr {

/// A scene has two surfaces (DESIGN section 9): what is made anew with every capture, and what
/// stays until something of it changes. Where a scene does not tell them apart, all is `moving`.
enum class Layer : std::uint8_t { moving, still };

}  // namespace mr
