#pragma once

#include <string>

namespace mr::apps {

/// "meshreduce 0.1.0", and lines on what matters for bug reports and licences.
std::string version_text();

}  // namespace mr::apps
