#include "mr/still/background.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/still/moving_pixels.h"
#include "mr/still/regions.h"

namespace mr::still {
namespace {

constexpr float kAgrees_sigmas = 3.5f, kTrusted_sigmas = 1.5f;
constexpr float kRounding_m = 0.002f;     // on top: files count millimetres
constexpr float kMostNoise = 4;           // times the stated precision
constexpr float kUncovered_m = 0.05f;     // what lies so much farther was hidden
constexpr std::uint16_t kMostReadings = 512;  // then the mean follows what is slow
constexpr int kQuick = 8, kSlow = 60;     // captures to learn
constexpr std::uint64_t kStart = 40;      // captures in which all is learnt quickly
constexpr int kContradicts = 5;           // farther readings that agree
constexpr double kLeastRegion = 30;       // pixels that change together, at 640x576
constexpr int kHandOver = 10;             // captures until the merger shows what is still
constexpr std::uint64_t kFreezeEvery = 8; // captures
constexpr std::uint64_t kFreezeAt = 4;    // plates are there by then of what is learnt at first
constexpr int kRefineTurns = 2;           // cubes are refined in so many turns
constexpr double kWorthRefining_m = 0.00075;
constexpr double kYoung_s = 60;           // absorbed surface that may go back as a whole
constexpr int kPushedFor = 5;

/// How a cube's share of the still picture differs from what is known by now.
struct CubeChange {
  int differs = 0;                    ///< pixels that came, went or lie elsewhere
  int refinable = 0, held = 0;        ///< pixels read three times as often; all that it shows
  double moved2_m2 = 0;               ///< sum over the refinable
};

std::uint32_t hash_of(Vec3i cube) {
  auto h = static_cast<std::uint32_t>(cube.x) * 73856093u ^
           static_cast<std::uint32_t>(cube.y) * 19349663u ^
           static_cast<std::uint32_t>(cube.z) * 83492791u;
  h ^= h >> 15;
  return h * 2654435761u >> 16;
}

}  // namespace

Background::Background(const Camera& camera, const Pose& T_world_camera,
                       const BackgroundConfig& config)
    : config_(config),
      width_(camera.width),
      height_(camera.height),
      after_captures_(std::max(kSlow, static_cast<int>(std::lround(config.after_s * config.fps)))),
      rays_(static_cast<std::size_t>(camera.width) * camera.height),
      eye_(vec_cast<float>(T_world_camera.translation)) {
  MR_ASSERT(config.chunk_m > 0 && config.fps > 0);
  parallel_for(height_, 32, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y)
      for (int x = 0; x < width_; ++x)
        rays_[y * width_ + x] = vec_cast<float>(
            T_world_camera.rotation * unproject(camera, {double(x), static_cast<double>(y)}));
  });
  begin_anew();
}

void Background::begin_anew() {
  pixels_.assign(rays_.size(), {});
  readings_.assign(rays_.size(), Reading::none);
  still_ = ImageDepth(width_, height_);
  previous_ = {};
  regions_.assign(1, {});
  captures_ = 0, pushed_for_ = 0, noise_ = 1;
}

float Background::sigma_m(float depth) const {
  return noise_ * static_cast<float>(config_.precision.sigma_m(depth));
}
float Background::band_m(float depth) const {
  return kAgrees_sigmas * sigma_m(depth) + kRounding_m;
}

double Background::least_region() const {
  return std::max(6.0, kLeastRegion * static_cast<double>(pixels_.size()) / (640.0 * 576.0));
}

Moment Background::update(const ImageDepth& depth) {
  MR_ASSERT(depth.width == width_ && depth.height == height_);
  Moment out;
  measure_noise(depth);
  read_pixels(depth);
  if (was_pushed()) {
    out.began_anew = out.still_changed = true;
    begin_anew();
    read_pixels(depth);
  }
  give_back_what_moves();
  forget_contradicted();
  absorb_what_stopped();
  if (captures_ % kFreezeEvery == kFreezeAt) out.still_changed |= freeze();
  out.moving = moving_pixels(depth, out.foreign);
  out.confirmed = confirmed_pixels(depth, out.moving);
  previous_ = depth;
  ++captures_;
  return out;
}

/// From the change of depth between two captures that three in ten pixels do not exceed: what
/// moves does not count.
void Background::measure_noise(const ImageDepth& depth) {
  constexpr std::size_t kEvery = 7, kEnough = 200;
  constexpr double kShare = 0.3;
  constexpr float kOfSigma = 0.3853f * 1.4142f;  // what 0.3 of the differences of two stay below
  constexpr float kFollows = 0.1f;
  if (previous_.empty()) return;
  std::vector<float> change;
  for (std::size_t i = 0; i < depth.data.size(); i += kEvery) {
    const float a = depth.data[i], b = previous_.data[i];
    if (a > 0 && b > 0)
      change.push_back(std::abs(a - b) / static_cast<float>(config_.precision.sigma_m(b)));
  }
  if (change.size() < kEnough) return;
  const auto at = change.begin() + static_cast<std::ptrdiff_t>(kShare * double(change.size()));
  std::nth_element(change.begin(), at, change.end());
  const float now = std::clamp(*at / kOfSigma, 1.0f, kMostNoise);
  noise_ = captures_ == 1 ? now : noise_ + kFollows * (now - noise_);
}

// --- one pixel

int Background::captures_to_learn(const Pixel& p) const {
  return captures_ < kStart || p.uncovered ? kQuick : kSlow;
}

/// Counts readings that agree with each other but not with what is known.
void Background::note_candidate(float depth, bool farther, Pixel& p) const {
  Surface& c = p.candidate;
  const float band = band_m(depth);
  if (c.count > 0 && p.farther == farther && std::abs(depth - c.mean) <= band) {
    if (c.count < 65535) ++c.count;
    c.mean += (depth - c.mean) / static_cast<float>(std::min(c.count, kMostReadings));
    return;
  }
  if (c.count > 0 && depth > c.mean + band + kUncovered_m) p.uncovered = true;
  if (c.count > 0 && depth < c.mean - band - kUncovered_m) p.uncovered = false;
  c = {depth, 1};
  p.farther = farther;
}

Background::Reading Background::read(float depth, Pixel& p) const {
  if (!(depth > 0)) return Reading::none;
  Surface& surface = known(p);
  if (surface.count == 0) {
    note_candidate(depth, false, p);
    if (p.candidate.count < captures_to_learn(p)) return Reading::unknown;
    p.base = std::exchange(p.candidate, {});
    p.uncovered = false, p.shown_for = 0;
    return Reading::agrees;
  }
  const float off = depth - surface.mean;
  const float sigma = sigma_m(surface.mean);
  if (std::abs(off) > kAgrees_sigmas * sigma + kRounding_m) {
    note_candidate(depth, off > 0, p);
    return off > 0 ? Reading::farther : Reading::nearer;
  }
  p.candidate.count = 0;
  if (p.shown_for < kHandOver) ++p.shown_for;
  // Trimmed on both sides, the mean stays where it is while a foot rests on the floor.
  if (std::abs(off) > kTrusted_sigmas * sigma + kRounding_m / 2) return Reading::agrees;
  if (surface.count < kMostReadings) ++surface.count;
  surface.mean += off / static_cast<float>(surface.count);
  return Reading::agrees;
}

void Background::read_pixels(const ImageDepth& depth) {
  parallel_for(height_, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin * width_; i < end * width_; ++i)
      readings_[i] = read(depth.data[i], pixels_[i]);
  });
}

// --- regions

bool Background::was_pushed() {
  constexpr double kLeastKnown = 0.1, kMostAgree = 0.6, kLeastFarther = 0.15;
  std::size_t agree = 0, nearer = 0, farther = 0;
  for (const Reading r : readings_) {
    agree += r == Reading::agrees;
    nearer += r == Reading::nearer;
    farther += r == Reading::farther;
  }
  const auto all = static_cast<double>(agree + nearer + farther);
  const bool most = all > kLeastKnown * static_cast<double>(readings_.size()) &&
                    static_cast<double>(agree) < kMostAgree * all &&
                    static_cast<double>(farther) > kLeastFarther * all;
  pushed_for_ = most ? pushed_for_ + 1 : 0;
  return pushed_for_ >= kPushedFor;
}

/// What was absorbed not long ago and moves again leaves as a whole: somebody who sat leaves no
/// shell.
void Background::give_back_what_moves() {
  constexpr double kShareThatMoves = 0.25;
  if (regions_.size() == 1) return;
  std::vector<std::uint32_t> moving(regions_.size());
  for (std::size_t i = 0; i < pixels_.size(); ++i)
    if (pixels_[i].absorbed.count > 0 &&
        (readings_[i] == Reading::nearer || readings_[i] == Reading::farther))
      ++moving[pixels_[i].region];
  std::vector<std::uint8_t> goes(regions_.size());
  bool any = false;
  for (std::size_t r = 1; r < regions_.size(); ++r) {
    const bool young = static_cast<double>(captures_ - regions_[r].since) < kYoung_s * config_.fps;
    goes[r] = young && moving[r] >= least_region() &&
              moving[r] > kShareThatMoves * static_cast<double>(regions_[r].pixels);
    any |= goes[r] != 0;
  }
  if (!any) return;
  for (Pixel& p : pixels_)
    if (p.absorbed.count > 0 && goes[p.region]) p.absorbed = {}, p.shown_for = 0;
}

/// Where so many farther readings agree that what stood there is gone.
void Background::forget_contradicted() {
  constexpr int kBeside = 2;  // readings that count beside those
  ImageMask mask(width_, height_);
  bool any = false;
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const Pixel& p = pixels_[i];
    mask.data[i] = known(p).count > 0 && p.farther && p.candidate.count >= kBeside;
    any |= mask.data[i] && p.candidate.count >= kContradicts;
  }
  if (!any) return;
  const Regions regions = connected_regions(mask);
  std::vector<std::uint32_t> sure(regions.pixels.size());
  for (std::size_t i = 0; i < pixels_.size(); ++i)
    sure[regions.label.data[i]] += pixels_[i].candidate.count >= kContradicts;
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const std::uint32_t r = regions.label.data[i];
    if (r == 0 || sure[r] < least_region()) continue;
    Pixel& p = pixels_[i];
    p.absorbed = {}, p.shown_for = 0, p.farther = false;
    if (p.base.count > 0 && std::abs(p.candidate.mean - p.base.mean) <= band_m(p.base.mean)) {
      p.candidate = {};
    } else if (p.candidate.mean > p.base.mean) {
      p.base = {}, p.uncovered = true;
    }
  }
}

/// What has been nearer than the room for so long belongs to it.
void Background::absorb_what_stopped() {
  ImageMask mask(width_, height_);
  bool any = false;
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const Pixel& p = pixels_[i];
    mask.data[i] = p.base.count > 0 && !p.farther && p.candidate.count >= after_captures_ / 2;
    any |= mask.data[i] && p.candidate.count >= after_captures_;
  }
  if (!any) return;
  const Regions regions = connected_regions(mask);
  std::vector<std::uint32_t> sure(regions.pixels.size());
  for (std::size_t i = 0; i < pixels_.size(); ++i)
    sure[regions.label.data[i]] += pixels_[i].candidate.count >= after_captures_;
  std::map<std::uint32_t, std::uint16_t> number;
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const std::uint32_t r = regions.label.data[i];
    if (r == 0 || sure[r] < least_region() || regions_.size() > 65000) continue;
    const auto [at, is_new] = number.try_emplace(r, static_cast<std::uint16_t>(regions_.size()));
    if (is_new) regions_.push_back({0, captures_});
    Pixel& p = pixels_[i];
    p.absorbed = std::exchange(p.candidate, {});
    p.region = at->second, p.shown_for = 0;
    ++regions_[at->second].pixels;
  }
}

// --- what comes out

/// Whether a pixel and those around it are, on average, nearer than what stays: less noise than
/// one pixel's, so that feet on the floor are told from it.
bool Background::is_slightly_nearer(const ImageDepth& depth, int x, int y) const {
  constexpr float kSlightly_sigmas = 1.2f;
  float sum = 0, sigma = 0;
  int count = 0;
  for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height_ - 1); ++v)
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width_ - 1); ++u) {
      const std::size_t i = static_cast<std::size_t>(v) * width_ + u;
      if (readings_[i] != Reading::agrees) continue;
      const float mean = known(pixels_[i]).mean;
      sum += depth.data[i] - mean, sigma += sigma_m(mean), ++count;
    }
  return count > 0 && sum < -kSlightly_sigmas * sigma;
}

ImageMask Background::moving_pixels(const ImageDepth& depth, ImageMask& foreign) const {
  ImageMask strong(width_, height_), no_depth(width_, height_);
  parallel_for(height_, 32, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin * width_; i < end * width_; ++i) {
      const Pixel& p = pixels_[i];
      const Reading reading = readings_[i];
      const bool shown = still_.data[i] > 0 && p.shown_for >= kHandOver;
      strong.data[i] = reading == Reading::nearer || reading == Reading::unknown ||
                       (reading != Reading::none && !shown);
      no_depth.data[i] = reading == Reading::none && known(p).count > 0;
    }
  });
  const auto weak = [&](int x, int y) {
    return readings_[static_cast<std::size_t>(y) * width_ + x] == Reading::agrees &&
           is_slightly_nearer(depth, x, y);
  };
  ImageMask moving = moving_regions(strong, no_depth, weak,
                                    static_cast<double>(pixels_.size()) / (640.0 * 576.0));
  foreign = moving;
  for (std::size_t i = 0; i < pixels_.size(); ++i)
    if (readings_[i] == Reading::agrees && pixels_[i].shown_for < kHandOver) foreign.data[i] = 0;
  return moving;
}

ImageMask Background::confirmed_pixels(const ImageDepth& depth, const ImageMask& moving) const {
  ImageMask out(width_, height_);
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const float z = still_.data[i];
    out.data[i] = z > 0 && !moving.data[i] && depth.data[i] > 0 &&
                  std::abs(depth.data[i] - z) <= band_m(z);
  }
  return out;
}

Vec3i Background::cube_of(std::size_t pixel, float depth) const {
  const Vec3f p = eye_ + rays_[pixel] * depth;
  const auto cell = [&](float v) {
    return static_cast<std::int32_t>(std::floor(v / static_cast<float>(config_.chunk_m)));
  };
  return {cell(p.x), cell(p.y), cell(p.z)};
}

/// Brings the still picture up to date, cube by cube: where enough pixels came or went, and where
/// it has become so much more exact that it shows. Returns whether it changed.
bool Background::freeze() {
  std::map<Vec3i, CubeChange> cubes;
  Vec3i last{};
  CubeChange* change = nullptr;
  const auto change_of = [&](Vec3i cube) -> CubeChange& {
    if (!change || cube != last) change = &cubes[cube], last = cube;
    return *change;
  };
  const auto differs = [&](float was, const Surface& now) {
    return (was > 0) != (now.count > 0) || std::abs(was - now.mean) > band_m(now.mean);
  };
  const auto is_refinable = [&](const Pixel& p) { return known(p).count >= 3 * p.frozen_count; };
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const Surface& now = known(pixels_[i]);
    const float was = still_.data[i];
    if (was == 0 && now.count == 0) continue;
    CubeChange& c = change_of(cube_of(i, was > 0 ? was : now.mean));
    ++c.held;
    if (differs(was, now)) {
      ++c.differs;
      if (was > 0 && now.count > 0) ++change_of(cube_of(i, now.mean)).differs;
    } else if (is_refinable(pixels_[i])) {
      const double off = now.mean - was;
      ++c.refinable, c.moved2_m2 += off * off;
    }
  }
  const auto turn = static_cast<std::uint32_t>(captures_ / kFreezeEvery) % kRefineTurns;
  for (auto item = cubes.begin(); item != cubes.end();) {
    const auto& [cube, c] = *item;
    const bool refine = c.refinable > c.held / 4 && hash_of(cube) % kRefineTurns == turn &&
                        c.moved2_m2 > kWorthRefining_m * kWorthRefining_m * c.refinable;
    item = c.differs >= least_region() || refine ? std::next(item) : cubes.erase(item);
  }
  if (cubes.empty()) return false;
  bool is_due = false;
  bool any = false;
  const auto due = [&](Vec3i cube) {
    if (!any || cube != last) is_due = cubes.contains(cube), last = cube, any = true;
    return is_due;
  };
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    Pixel& p = pixels_[i];
    const Surface& now = known(p);
    const float was = still_.data[i];
    if ((was == 0 && now.count == 0) ||
        !((was > 0 && due(cube_of(i, was))) || (now.count > 0 && due(cube_of(i, now.mean)))))
      continue;
    const bool other = differs(was, now);
    if (!other && now.count < 2 * p.frozen_count) continue;
    still_.data[i] = now.count > 0 ? now.mean : 0;
    p.frozen_count = now.count;
    if (other) p.shown_for = 0;
  }
  return true;
}

}  // namespace mr::still
