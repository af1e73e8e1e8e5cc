#include "mr/sensor/realsense/captures.h"

#include <algorithm>
#include <utility>

namespace mr::sensor {
namespace {

// Of one stream, while the other has none.
constexpr std::size_t kMostPicturesWaiting = 64, kMostBytesWaiting = 256 << 20;
constexpr Duration kMostLate = std::chrono::seconds(1);  // pictures wait before they are written

std::size_t bytes_of(const RealSensePicture& picture) {
  return picture.bytes ? picture.bytes->size() : 0;
}

Duration longest_period(const RealSenseHeader& header) {
  const double fps = header.color ? header.color->fps : 0;
  const auto color = Duration(fps > 0 ? static_cast<std::int64_t>(1e9 / fps) : 0);
  return std::max(header.period, color);
}

}  // namespace

RealSenseCaptures::RealSenseCaptures(RealSenseRecording recording, bool with_color)
    : recording_(std::move(recording)),
      with_color_(with_color && recording_.header().color.has_value()),
      longest_period_(longest_period(recording_.header())) {}

Status RealSenseCaptures::seek(TimePoint at) {
  color_.clear(), depth_.clear();
  waiting_bytes_ = 0;
  error_.reset();
  ended_ = false;
  return recording_.seek(at);
}

/// Whether the first depth picture's colour is known: colour as late as it was read, or can not
/// come any more.
bool RealSenseCaptures::is_decided() const {
  if (depth_.empty()) return false;
  const TimePoint at = depth_.front().at;
  return !with_color_ || (!color_.empty() && color_.back().at >= at) ||
         depth_.back().at > at + kMostLate || depth_.size() > kMostPicturesWaiting ||
         waiting_bytes_ > kMostBytesWaiting;
}

Status RealSenseCaptures::read_ahead() {
  while (!ended_ && !is_decided()) {
    auto picture = recording_.next();
    if (!picture || !*picture) ended_ = true;
    if (!picture) return picture.error();
    if (!*picture) return {};
    const bool is_depth = (*picture)->stream == RealSenseStream::depth;
    if (!is_depth && !with_color_) continue;
    waiting_bytes_ += bytes_of(**picture);
    (is_depth ? depth_ : color_).push_back(**std::move(picture));
    while (color_.size() > kMostPicturesWaiting ||
           (color_.size() > 1 && waiting_bytes_ > kMostBytesWaiting)) {
      waiting_bytes_ -= bytes_of(color_.front());
      color_.pop_front();
    }
  }
  return {};
}

/// The nearest colour; what neither `at` nor a waiting depth picture needs is dropped.
std::optional<RealSensePicture> RealSenseCaptures::nearest_color(TimePoint at) {
  TimePoint needed = at;
  for (const RealSensePicture& waiting : depth_) needed = std::min(needed, waiting.at);
  while (color_.size() > 1 && color_[1].at <= needed) {
    waiting_bytes_ -= bytes_of(color_.front());
    color_.pop_front();
  }
  const auto apart = [at](const RealSensePicture& picture) {
    return std::chrono::abs(picture.at - at);
  };
  const auto nearest = std::ranges::min_element(color_, {}, apart);
  if (nearest == color_.end() || 2 * apart(*nearest) > longest_period_) return std::nullopt;
  return *nearest;
}

Result<std::optional<RealSenseCapture>> RealSenseCaptures::next() {
  if (const Status read = read_ahead(); !read) error_ = read.error();
  if (depth_.empty()) {
    if (error_) return *std::exchange(error_, std::nullopt);
    return std::optional<RealSenseCapture>();
  }
  RealSenseCapture out;
  out.depth = std::move(depth_.front());
  depth_.pop_front();
  waiting_bytes_ -= bytes_of(out.depth);
  if (with_color_) out.color = nearest_color(out.depth.at);
  return std::optional(std::move(out));
}

}  // namespace mr::sensor
