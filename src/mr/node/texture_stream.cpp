#include "mr/node/texture_stream.h"

#include <algorithm>

namespace mr::node {
namespace {

ImageRgb padded_to_even(const ImageRgb& picture) {
  ImageRgb out((picture.width + 1) / 2 * 2, (picture.height + 1) / 2 * 2);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x)
      std::copy_n(picture.at(std::min(x, picture.width - 1), std::min(y, picture.height - 1)), 3,
                  out.at(x, y));
  return out;
}

}  // namespace

bool TextureStream::is_key_frame_due(int width, int height, std::uint32_t layout) const {
  if (!encoder_ || key_frame_asked_ || layout != layout_) return true;
  const kit::VideoSettings& now = encoder_->settings();
  const auto even = [](int side) { return (side + 1) / 2 * 2; };
  return now.width != even(width) || now.height != even(height) ||
         (now.key_frame_every > 0 && since_key_frame_ + 1 >= now.key_frame_every);
}

Result<TextureUnit> TextureStream::encode(const ImageRgb& picture, int qp, std::uint32_t layout) {
  return encode(picture, qp, layout, nullptr);
}

Result<TextureUnit> TextureStream::refine(const ImageRgb& picture, int qp, std::uint32_t layout,
                                          kit::RowBand band) {
  return encode(picture, qp, layout, &band);
}

Result<TextureUnit> TextureStream::encode(const ImageRgb& picture, int qp, std::uint32_t layout,
                                          const kit::RowBand* band) {
  if (picture.width % 2 || picture.height % 2)
    return encode(padded_to_even(picture), qp, layout, band);
  kit::VideoSettings wanted{picture.width,         picture.height,      scene_->fps, qp,
                            scene_->video.threads, scene_->video.slices};
  if (!periodic_) wanted.key_frame_every = 0;
  wanted.bands = !periodic_ && scene_->rate.model != RateConfig::Model::fixed;
  if (encoder_) encoder_->set_qp(qp);
  if (!encoder_ || encoder_->settings() != wanted) {
    auto encoder = kit::VideoEncoder::create(wanted);
    if (!encoder) return encoder.error();
    encoder_.emplace(*std::move(encoder));
    key_frame_asked_ = true;
  }
  const bool asked = key_frame_asked_.exchange(false);
  const bool is_key_frame = asked || layout != layout_;
  auto unit = band && !is_key_frame ? encoder_->encode_band(picture, *band)
                                    : encoder_->encode(picture, is_key_frame);
  if (!unit) {
    if (asked) key_frame_asked_ = true;
    return unit.error();
  }
  layout_ = layout;
  since_key_frame_ = unit->key_frame ? 0 : since_key_frame_ + 1;
  return TextureUnit{stream_,       serial_++,      TextureCodec::h264, layout,
                     picture.width, picture.height, unit->key_frame,    std::move(unit->data)};
}

}  // namespace mr::node
