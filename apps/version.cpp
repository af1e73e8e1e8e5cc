#include "version.h"

#include <fmt/format.h>

#include "mr/core/simd.h"
#include "mr/kit/video.h"

namespace mr::apps {
namespace {

std::string compiler() {
#ifdef __clang__
  return fmt::format("clang++ {}", __clang_version__);
#else
  return fmt::format("g++ {}", __VERSION__);
#endif
}

}  // namespace

std::string version_text() {
  const kit::VideoLibrary video = kit::video_library();
  return fmt::format(
      "meshreduce {}\n"
      "built by {} ({}); vector code for {}\n"
      "libavcodec {}, licence: {}, which holds for this program as a whole",
      MR_VERSION, compiler(), MR_BUILD_TYPE, simd_target(), video.version, video.licence);
}

}  // namespace mr::apps
