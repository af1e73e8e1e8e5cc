#pragma once

#include <string_view>

namespace mr::rate {

/// The text of models.json, as it was when the program was built.
extern const std::string_view kShippedModels;

}  // namespace mr::rate
