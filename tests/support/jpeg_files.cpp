#include "support/jpeg_files.h"

#include <turbojpeg.h>

#include <cstdlib>
#include <string>

namespace mr::test {
namespace {

std::vector<std::byte> compressed(std::span<const std::uint8_t> pixels, int width, int height,
                                  TJPF format, TJSAMP chroma, int quality, int flags) {
  const tjhandle turbo = tjInitCompress();
  unsigned char* coded = nullptr;
  unsigned long size = 0;
  if (turbo == nullptr || tjCompress2(turbo, pixels.data(), width, 0, height, format, &coded, &size,
                                      chroma, quality, flags) != 0)
    std::abort();
  const auto* first = reinterpret_cast<const std::byte*>(coded);
  std::vector<std::byte> out(first, first + size);
  tjFree(coded);
  tjDestroy(turbo);
  return out;
}

}  // namespace

std::vector<std::byte> jpeg_file(const ImageRgb& image, const JpegKind& kind) {
  constexpr TJSAMP kSubsampling[] = {TJSAMP_444, TJSAMP_422, TJSAMP_440, TJSAMP_420, TJSAMP_GRAY};
  return compressed(image.data, image.width, image.height, TJPF_RGB,
                    kSubsampling[static_cast<int>(kind.chroma)], kind.quality,
                    kind.progressive ? TJFLAG_PROGRESSIVE : 0);
}

std::vector<std::byte> cmyk_jpeg_file(int width, int height) {
  const std::vector<std::uint8_t> inks(static_cast<std::size_t>(width) * height * 4, 100);
  return compressed(inks, width, height, TJPF_CMYK, TJSAMP_444, 90, 0);
}

std::size_t jpeg_frame_header_at(std::span<const std::byte> jpeg) {
  for (std::size_t i = 0; i + 1 < jpeg.size(); ++i)
    if (jpeg[i] == std::byte{0xFF} &&
        (jpeg[i + 1] == std::byte{0xC0} || jpeg[i + 1] == std::byte{0xC2}))
      return i;
  std::abort();
}

}  // namespace mr::test
