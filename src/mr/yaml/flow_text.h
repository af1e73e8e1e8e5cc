#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "mr/core/camera.h"
#include "mr/core/pose.h"
#include "mr/yaml/tree.h"

/// Writes values as flow YAML, on one line where nothing else is said.
namespace mr::yaml {

/// The shortest text that reads back as the same number.
std::string exact_text(double value);

/// [1, 2, 3]
std::string list_text(std::span<const double> values);

/// In double quotes, with what has to be escaped escaped.
std::string quoted_text(std::string_view text);

/// A camera as scene files have it: {model: pinhole, size: [640, 480], fx: …}.
std::string camera_text(const Camera& camera);

/// A tree as text. Every scalar goes through `change` first. Lines longer than 100 columns are
/// wrapped between entries; the first begins at `column`, the others are indented by `indent`.
std::string flow_text(Node node, int column, int indent,
                      const std::function<void(Node& scalar)>& change);

}  // namespace mr::yaml
