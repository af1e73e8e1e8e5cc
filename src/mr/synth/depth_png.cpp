#include "mr/synth/depth_png.h"

#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "mr/core/file.h"

namespace mr::synth {

Status write_depth_png(const std::filesystem::path& file, int width, int height,
                       std::span<const std::uint16_t> counts) {
  MR_ASSERT(counts.size() == static_cast<std::size_t>(width) * height);
  cv::Mat image(height, width, CV_16UC1);
  std::memcpy(image.data, counts.data(), counts.size_bytes());
  try {
    std::vector<std::uint8_t> coded;
    if (cv::imencode(".png", image, coded))
      return write_file(file, std::as_bytes(std::span(coded)));
    return Error{Error::Cause::unsupported, file.string() + ": cannot encode a PNG"};
  } catch (const std::exception& e) {
    return Error{Error::Cause::unsupported, file.string() + ": " + e.what()};
  }
}

}  // namespace mr::synth
