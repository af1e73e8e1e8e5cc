#include "mr/still/background.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/still/connected_components.h"
#include "mr/still/moving_pixels.h"

namespace mr::still {
namespace {

constexpr float kAgrees_sigmas = 3.5f, kTrusted_sigmas = 1.5f;
constexpr float kRounding_m = 0.002f;         // added: files store whole millimetres
constexpr float kMostNoise = 4;               // times the stated precision
constexpr float kUncovered_m = 0.05f;         // surface this much farther was occluded
constexpr std::uint16_t kMostReadings = 512;  // limit of the running mean, to follow slow drift
constexpr int kQuick = 8, kSlow = 60;         // captures to learn
constexpr std::uint64_t kStart = 40;          // captures of quick learning at the start
constexpr int kContradicts = 5;               // farther readings that agree to contradict the model
constexpr std::uint16_t kAgainstDoubt = 4;  // captures without depth that one valid depth outweighs
constexpr double kLeastRegion = 30;         // pixels that change together, at 640x576
constexpr std::uint8_t kHandOver = 10;      // captures until the merger shows the still surface
// Intervals in captures between checks for updates of the still picture: kCheckEvery for surface
// that disappeared or moved, kFreezeEvery also for new surface, kRefineEvery also for small regions
// and refinement. The first check, at kCheckAt, is late enough for clean plates of the surface
// learnt at the start.
constexpr std::uint64_t kCheckEvery = 8, kCheckAt = 4, kFreezeEvery = 32, kRefineEvery = 512;
constexpr int kRefineTurns = 2;         // at the start, cubes are refined in this many turns
constexpr std::uint8_t kRestless = 60;  // captures without learning until a pixel counts as noisy
constexpr double kWorthRefining_m = 0.0005, kWorthRefining_sigmas = 0.17;
constexpr double kWorthRefining_voxels = 0.15;  // after the start: a refined chunk is sent again
constexpr double kYoung_s = 60;  // absorbed objects younger than this may be released
constexpr int kPushedFor = 5;

/// Difference between still() and the model in one cube.
struct CubeChange {
  int differs = 0;              ///< pixels that appeared, disappeared or moved
  int refinable = 0, held = 0;  ///< pixels with three times the readings; all pixels
  double moved2_m2 = 0;         ///< sum of squared differences of refinable pixels
  double sigma2_m2 = 0;         ///< sum of their squared noise
};

/// Whether a value is a possible depth.
bool is_measured(float depth) {
  constexpr float kFarthest_m = 1e5f;
  return depth > 0 && depth < kFarthest_m;
}

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
  reset();
}

void Background::reset() {
  models_.assign(rays_.size(), {});
  details_.assign(rays_.size(), {});
  readings_.assign(rays_.size(), Reading::none);
  still_ = ImageDepth(width_, height_);
  previous_ = {};
  regions_.assign(1, {});
  captures_ = 0, pushed_for_ = 0, noise_ = 1, usually_read_ = 0;
}

float Background::sigma_m(float depth) const {
  return noise_ * static_cast<float>(config_.precision.sigma_m(depth));
}
float Background::band_m(float depth) const {
  return kAgrees_sigmas * sigma_m(depth) + kRounding_m;
}

double Background::least_region() const {
  return std::max(6.0, kLeastRegion * static_cast<double>(models_.size()) / (640.0 * 576.0));
}

bool Background::is_new() const { return captures_ < 2 * kFreezeEvery; }

BackgroundUpdate Background::update(const ImageDepth& depth, std::uint32_t shown) {
  MR_ASSERT(depth.width == width_ && depth.height == height_);
  shown_ = shown;
  BackgroundUpdate out;
  measure_noise(depth);
  read_pixels(depth);
  if (camera_has_moved()) {
    out.was_reset = out.still_changed = true;
    reset();
    read_pixels(depth);
  }
  release_absorbed_that_moves();
  forget_contradicted();
  absorb_what_stopped();
  if (captures_ % kCheckEvery == kCheckAt) out.still_changed |= freeze();
  out.moving = moving_pixels(depth, out.foreign);
  out.confirmed = confirmed_pixels(depth, out.moving);
  count_missing_readings(out.moving);
  previous_ = depth;
  ++captures_;
  return out;
}

/// Robust estimate of noise: from the 30th percentile of the change of depth between two captures,
/// so that moving pixels do not count.
void Background::measure_noise(const ImageDepth& depth) {
  constexpr std::size_t kEvery = 29, kEnough = 100;
  constexpr double kShare = 0.3;
  constexpr float kOfSigma = 0.3853f * 1.4142f;  // 30th percentile of |difference| of two Gaussians
  constexpr float kFollows = 0.1f;
  if (previous_.empty()) return;
  std::vector<float> change;
  for (std::size_t i = 0; i < depth.data.size(); i += kEvery) {
    const float a = depth.data[i], b = previous_.data[i];
    if (is_measured(a) && is_measured(b))
      change.push_back(std::abs(a - b) / static_cast<float>(config_.precision.sigma_m(b)));
  }
  if (change.size() < kEnough) return;
  const auto at = change.begin() + static_cast<std::ptrdiff_t>(kShare * double(change.size()));
  std::nth_element(change.begin(), at, change.end());
  const float now = std::clamp(*at / kOfSigma, 1.0f, kMostNoise);
  noise_ = captures_ == 1 ? now : noise_ + kFollows * (now - noise_);
}

/// Calls row(y, begin, end) with the pixel indices of each row, in parallel.
template <typename Row>
void Background::for_each_row(const Row& row) const {
  parallel_for(height_, 16, [&](std::size_t first, std::size_t last) {
    for (std::size_t y = first; y < last; ++y) row(y, y * width_, (y + 1) * width_);
  });
}

// --- one pixel

int Background::captures_to_learn(const PixelModel& known) const {
  return captures_ < kStart || known.was_uncovered ? kQuick : kSlow;
}

/// Updates the candidate: depths that agree with each other but not with the model. At a depth edge
/// they jump between two surfaces; in an unknown pixel the more frequent one wins (majority vote).
void Background::note_candidate(float depth, bool farther, PixelModel& known,
                                PixelModelDetail& detail) const {
  Surface& c = detail.candidate;
  const bool any = known.has_candidate;
  const float band = band_m(depth);  // combined spread of a reading and a mean of few
  const float wide = band * std::sqrt(1 + 1 / static_cast<float>(std::max<int>(c.count, 1)));
  if (any && known.is_farther == farther && std::abs(depth - c.mean) <= wide) {
    if (c.count < 65535) ++c.count;
    c.mean += (depth - c.mean) / static_cast<float>(std::min(c.count, kMostReadings));
    return;
  }
  if (any && known.count == 0 && c.count > 1) {          // two disagreeing readings cancel one
    c.count = std::min<std::uint16_t>(c.count, kQuick);  // a long-lived candidate fades quickly
    known.was_missed = !known.was_missed;
    if (known.was_missed || --c.count > 1) return;
  }
  if (any && depth > c.mean + band + kUncovered_m) known.was_uncovered = true;
  if (any && depth < c.mean - band - kUncovered_m) known.was_uncovered = false;
  c = {depth, 1};
  known.has_candidate = true, known.is_farther = farther;
}

/// Forgets the absorbed object of a pixel, or if there is none, the background.
void Background::forget(PixelModel& known, PixelModelDetail& detail) {
  const Surface behind = known.is_absorbed ? std::exchange(detail.base, {}) : Surface{};
  known.mean = behind.mean, known.count = behind.count;
  known.is_absorbed = known.is_doubted = false, known.age = 0;
  detail.doubt = 0;
}

/// A valid depth lowers the count of captures without one.
void Background::trust(PixelModel& known, PixelModelDetail& detail) {
  if (!known.is_doubted) return;
  detail.doubt -= std::min(detail.doubt, kAgainstDoubt);
  known.is_doubted = detail.doubt > 0;
}

/// Whether a blank pixel sees its former background again: a black object had been in front of it.
bool Background::is_as_before(const PixelModel& known, const PixelModelDetail& detail) const {
  return known.has_candidate && detail.base.count >= kSlow && detail.candidate.count >= kQuick &&
         std::abs(detail.candidate.mean - detail.base.mean) <= band_m(detail.base.mean);
}

Background::Reading Background::read(float depth, PixelModel& known,
                                     PixelModelDetail& detail) const {
  if (!is_measured(depth)) return Reading::none;
  if (known.count == 0) {
    trust(known, detail);
    note_candidate(depth, false, known, detail);
    if (known.age < kRestless) ++known.age;
    const bool learnt = known.is_blank ? is_as_before(known, detail)
                                       : detail.candidate.count >= captures_to_learn(known);
    if (!learnt) return Reading::unknown;
    detail.doubt = 0, detail.base = {};
    known = {.mean = detail.candidate.mean, .count = detail.candidate.count};
    return Reading::agrees;
  }
  const float off = depth - known.mean, sigma = sigma_m(known.mean);
  if (std::abs(off) > kAgrees_sigmas * sigma + kRounding_m) {
    note_candidate(depth, off > 0, known, detail);
    return off > 0 ? Reading::farther : Reading::nearer;
  }
  trust(known, detail);
  known.has_candidate = known.is_farther = false;
  if (known.age < kHandOver && shown_ > 0 && detail.change <= shown_) ++known.age;
  // A trimmed mean: deviating depths do not count, so that a foot on the floor does not shift it.
  if (std::abs(off) > kTrusted_sigmas * sigma + kRounding_m / 2) return Reading::agrees;
  if (known.count < kMostReadings)
    ++known.count;
  else
    known.is_blank = false;
  known.mean += off / static_cast<float>(known.count);
  return Reading::agrees;
}

void Background::read_pixels(const ImageDepth& depth) {
  std::vector<std::uint8_t> contradicted(height_), stopped(height_);
  std::vector<std::uint32_t> measured(height_);
  for_each_row([&](std::size_t y, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      PixelModel& known = models_[i];
      readings_[i] = read(depth.data[i], known, details_[i]);
      measured[y] += readings_[i] != Reading::none;
      if (!known.has_candidate || (known.count == 0 && !known.is_blank)) continue;
      const int count = details_[i].candidate.count;
      contradicted[y] |= known.is_farther && count >= kContradicts;
      stopped[y] |= count >= after_captures_;
    }
  });
  const auto any = [](const std::vector<std::uint8_t>& rows) {
    return std::ranges::find(rows, 1) != rows.end();
  };
  any_contradicted_ = any(contradicted), any_stopped_ = any(stopped);
  update_expected_readings(std::accumulate(measured.begin(), measured.end(), 0.0));
}

/// Detects a dropout: far fewer valid pixels than the slow mean, or hardly any. A lasting change
/// becomes the new mean.
void Background::update_expected_readings(double pixels) {
  constexpr double kFollows = 1.0 / 128, kFarFewer = 0.5, kLeast = 0.05;
  usually_read_ += (captures_ == 0 ? 1 : kFollows) * (pixels - usually_read_);
  usually_read_ = std::max(usually_read_, kLeast * static_cast<double>(models_.size()));
  drops_out_ = pixels < kFarFewer * usually_read_;
}

// --- regions

bool Background::camera_has_moved() {
  constexpr double kLeastKnown = 0.1, kMostAgree = 0.6, kLeastFarther = 0.15;
  const auto count = [&](Reading r) { return std::ranges::count(readings_, r); };
  const auto agree = count(Reading::agrees), farther = count(Reading::farther);
  const auto all = static_cast<double>(agree + farther + count(Reading::nearer));
  const bool most =
      all > kLeastKnown * static_cast<double>(readings_.size()) &&
      static_cast<double>(agree)<kMostAgree * all&& static_cast<double>(farther)> kLeastFarther *
          all;
  pushed_for_ = most ? pushed_for_ + 1 : 0;
  return pushed_for_ >= kPushedFor;
}

/// Releases recently absorbed objects that move again, each as a whole, so that a person who gets
/// up leaves no remains behind.
void Background::release_absorbed_that_moves() {
  constexpr double kShareThatMoves = 0.25;
  constexpr int kGone = 12;  // captures without a reading
  if (regions_.size() == 1) return;
  std::vector<std::uint32_t> moving(regions_.size());
  for (std::size_t i = 0; i < models_.size(); ++i) {
    if (!models_[i].is_absorbed) continue;
    const Reading now = readings_[i];
    const bool is_gone = now == Reading::none && models_[i].is_blank && details_[i].doubt >= kGone;
    moving[details_[i].region] += now == Reading::nearer || now == Reading::farther || is_gone;
  }
  std::vector<std::uint8_t> goes(regions_.size());
  bool any = false;
  for (std::size_t r = 1; r < regions_.size(); ++r) {
    const bool young = static_cast<double>(captures_ - regions_[r].since) < kYoung_s * config_.fps;
    goes[r] = young && moving[r] >= least_region() &&
              moving[r] > kShareThatMoves * static_cast<double>(regions_[r].pixels);
    any |= goes[r] != 0;
  }
  if (!any) return;
  for (std::size_t i = 0; i < models_.size(); ++i)
    if (models_[i].is_absorbed && goes[details_[i].region]) forget(models_[i], details_[i]);
}

/// Connected components of pixels whose candidate has at least `beside` depths, if enough of their
/// pixels have at least `sure` (hysteresis). `fits(model)`: which candidates count.
template <typename Fits>
std::optional<ConnectedComponents> Background::candidates(int beside, int sure,
                                                          const Fits& fits) const {
  ImageMask mask(width_, height_);
  std::vector<std::uint8_t> any(height_);
  for_each_row([&](std::size_t y, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const PixelModel& known = models_[i];
      if (!known.has_candidate || (known.count == 0 && !known.is_blank) || !fits(known)) continue;
      mask.data[i] = details_[i].candidate.count >= beside;
      any[y] |= details_[i].candidate.count >= sure;
    }
  });
  if (std::ranges::count(any, 0) == height_) return std::nullopt;
  ConnectedComponents regions = connected_components(mask);
  std::vector<std::uint32_t> enough(regions.pixels.size());
  regions.for_each_pixel(width_, [&](std::size_t i, std::uint32_t region) {
    enough[region] += details_[i].candidate.count >= sure;
  });
  std::erase_if(regions.runs, [&](const Run& s) { return enough[s.region] < least_region(); });
  return regions;
}

/// Forgets pixels where so many farther depths agree that the object there must be gone.
void Background::forget_contradicted() {
  constexpr int kBeside = 2;  // readings of the weaker pixels of a region
  if (!any_contradicted_) return;
  const auto regions =
      candidates(kBeside, kContradicts, [](const PixelModel& k) { return k.is_farther; });
  if (!regions) return;
  regions->for_each_pixel(width_, [&](std::size_t i, std::uint32_t) {
    PixelModel& known = models_[i];
    PixelModelDetail& detail = details_[i];
    if (known.is_absorbed) forget(known, detail);
    const float behind = detail.candidate.mean - known.mean;
    if (std::abs(behind) <= band_m(known.mean))
      known.has_candidate = false;
    else if (behind > 0)
      forget(known, detail), known.was_uncovered = true;
    known.is_farther = false;
  });
}

/// An object in front of an unmeasurable background leaves no farther depth when it goes away. It
/// is gone when its pixels have no valid depth for long although nothing moves in front of them.
void Background::count_missing_readings(const ImageMask& moving) {
  if (drops_out_) return;
  for_each_row([&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (readings_[i] == Reading::none && !moving.data[i]) doubt(models_[i], details_[i]);
  });
}

void Background::doubt(PixelModel& known, PixelModelDetail& detail) const {
  constexpr int kLeast = 30, kBlank = 16;
  known.is_doubted = true;
  if (++detail.doubt < (known.count > 0 ? kLeast + known.count : kBlank)) return;
  if (known.count > 0) {
    const bool is_base = !known.is_absorbed;
    const Surface before{known.mean, known.count};
    forget(known, detail);
    if (is_base) detail.base = before;
    if (known.count > 0) return;  // what is behind
  }
  known.is_blank = true, known.has_candidate = known.was_uncovered = known.is_doubted = false;
  detail.doubt = 0;
}

/// Counts the remaining pixels of each absorbed region.
void Background::count_absorbed() {
  for (AbsorbedRegion& region : regions_) region.pixels = 0;
  for (std::size_t i = 0; i < models_.size(); ++i)
    if (models_[i].is_absorbed) ++regions_[details_[i].region].pixels;
}

/// A free number for a new absorbed region; 0: there is none.
std::uint16_t Background::new_region() {
  std::size_t number = 1;
  while (number < regions_.size() &&
         (regions_[number].pixels > 0 || regions_[number].since == captures_))
    ++number;
  if (number > 65535) return 0;
  if (number == regions_.size()) regions_.emplace_back();
  regions_[number] = {0, captures_};
  return static_cast<std::uint16_t>(number);
}

/// Absorbs objects that have stayed in front of the background for after_s.
void Background::absorb_what_stopped() {
  if (!any_stopped_) return;
  const auto regions = candidates(after_captures_ / 2, after_captures_,
                                  [](const PixelModel& k) { return !k.is_farther; });
  if (!regions) return;
  std::map<std::uint32_t, std::uint16_t> number;
  count_absorbed();
  regions->for_each_pixel(width_, [&](std::size_t i, std::uint32_t region) {
    const auto [at, is_new] = number.try_emplace(region, std::uint16_t{0});
    if (is_new) at->second = new_region();
    if (at->second == 0) return;  // all region numbers are in use
    PixelModel& known = models_[i];
    PixelModelDetail& detail = details_[i];
    if (!known.is_absorbed) detail.base = {known.mean, known.count};
    known = {.mean = detail.candidate.mean,
             .count = std::min(detail.candidate.count, kMostReadings),
             .is_absorbed = true,
             .is_blank = known.is_blank};
    detail.region = at->second, detail.doubt = 0;
    ++regions_[at->second].pixels;
  });
}

// --- results

/// Whether the mean over a pixel's neighbourhood is nearer than the background: less noisy than one
/// pixel, so that feet are distinguished from the floor.
bool Background::is_slightly_nearer(const ImageDepth& depth, int x, int y) const {
  constexpr float kSlightly_sigmas = 1.2f;
  float sum = 0, sigma = 0;
  int count = 0;
  for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height_ - 1); ++v)
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width_ - 1); ++u) {
      const std::size_t i = static_cast<std::size_t>(v) * width_ + u;
      if (readings_[i] != Reading::agrees) continue;
      const float mean = models_[i].mean;
      sum += depth.data[i] - mean, sigma += sigma_m(mean), ++count;
    }
  return count > 0 && sum < -kSlightly_sigmas * sigma;
}

/// Whether the still surface has been shown at a pixel long enough for the hand-over.
bool Background::is_shown(std::size_t pixel) const {
  return still_.data[pixel] > 0 && models_[pixel].age >= kHandOver && !differs(pixel);
}

/// Whether a pixel lies at a depth edge of the background, where depth keeps jumping and means
/// nothing.
bool Background::is_mixed(int x, int y) const {
  constexpr int kReach_px = 2;
  const std::size_t i = static_cast<std::size_t>(y) * width_ + x;
  if (readings_[i] != Reading::unknown || models_[i].age < kRestless) return false;
  for (int v = std::max(y - kReach_px, 0); v <= std::min(y + kReach_px, height_ - 1); ++v)
    for (int u = std::max(x - kReach_px, 0); u <= std::min(x + kReach_px, width_ - 1); ++u)
      if (readings_[static_cast<std::size_t>(v) * width_ + u] == Reading::agrees) return true;
  return false;
}

ImageMask Background::moving_pixels(const ImageDepth& depth, ImageMask& foreign) const {
  ImageMask strong(width_, height_), no_depth(width_, height_);
  for_each_row([&](std::size_t y, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Reading reading = readings_[i];
      const bool mixed = is_mixed(static_cast<int>(i - begin), static_cast<int>(y));
      strong.data[i] =
          !mixed && reading != Reading::none && (reading == Reading::nearer || !is_shown(i));
      no_depth.data[i] = mixed || reading == Reading::none;
    }
  });
  const auto weak = [&](int x, int y) {
    return readings_[static_cast<std::size_t>(y) * width_ + x] == Reading::agrees &&
           is_slightly_nearer(depth, x, y);
  };
  ImageMask moving =
      moving_regions(strong, no_depth, weak, static_cast<double>(models_.size()) / (640.0 * 576.0));
  foreign = moving;
  for_each_row([&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (moving.data[i] && readings_[i] == Reading::agrees && !is_shown(i)) foreign.data[i] = 0;
  });
  return moving;
}

ImageMask Background::confirmed_pixels(const ImageDepth& depth, const ImageMask& moving) const {
  ImageMask out(width_, height_);
  for_each_row([&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const float z = still_.data[i], d = depth.data[i];
      out.data[i] = (z > 0) & (d > 0) & !moving.data[i] & (std::abs(d - z) <= band_m(z));
    }
  });
  return out;
}

Vec3i Background::cube_of(std::size_t pixel, float depth) const {
  const Vec3f p = eye_ + rays_[pixel] * depth;
  const auto cell = [&](float v) {
    return static_cast<std::int32_t>(std::floor(v / static_cast<float>(config_.chunk_m)));
  };
  return {cell(p.x), cell(p.y), cell(p.z)};
}

/// Whether still() and the model show different surfaces at a pixel.
bool Background::differs(std::size_t pixel) const {
  const PixelModel& now = models_[pixel];
  const float was = still_.data[pixel];
  if ((was > 0) != (now.count > 0)) return true;
  const float off = std::abs(was - now.mean);
  return was > 0 && off > kRounding_m && off > band_m(now.mean);
}

/// The pixels of still() to be updated: regions that appeared, disappeared or moved. Large regions
/// that disappeared are updated at every check, all others at less frequent ones.
ImageMask Background::regions_to_freeze() const {
  const bool all = is_new() || captures_ % kFreezeEvery == kCheckAt;
  const double times = is_new() || captures_ % kRefineEvery == kCheckAt ? 1 : all ? 3 : 10;
  ImageMask mask(width_, height_);
  for_each_row([&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      mask.data[i] = (all || still_.data[i] > 0) && differs(i);
  });
  const ConnectedComponents regions = connected_components(mask);
  regions.for_each_pixel(width_, [&](std::size_t i, std::uint32_t region) {
    mask.data[i] = regions.pixels[region] >= times * least_region();
  });
  return mask;
}

/// Cubes to be updated as a whole: with many scattered changes, or where the model has become
/// visibly more precise than still().
std::set<Vec3i> Background::cubes_to_refine() const {
  constexpr double kMuch = 0.05;
  if (!is_new() && captures_ % kRefineEvery != kCheckAt) return {};
  std::map<Vec3i, CubeChange> cubes;
  Vec3i last{};
  CubeChange* change = nullptr;
  for (std::size_t i = 0; i < models_.size(); ++i) {
    const PixelModel& now = models_[i];
    const float was = still_.data[i];
    if (was == 0 && now.count == 0) continue;
    const Vec3i cube = cube_of(i, was > 0 ? was : now.mean);
    if (!change || cube != last) change = &cubes[cube], last = cube;
    ++change->held;
    if (differs(i)) {
      ++change->differs;
    } else if (now.count >= 3 * details_[i].frozen_count) {
      const double off = now.mean - was, sigma = sigma_m(was);
      ++change->refinable, change->moved2_m2 += off * off, change->sigma2_m2 += sigma * sigma;
    }
  }
  std::set<Vec3i> out;
  const double worth_m = is_new() ? kWorthRefining_m : kWorthRefining_voxels * config_.voxel_m;
  const auto turn = static_cast<std::uint32_t>(captures_ / kCheckEvery) % kRefineTurns;
  for (const auto& [cube, c] : cubes) {
    const double worth2_m2 = std::max(worth_m * worth_m * c.refinable,
                                      kWorthRefining_sigmas * kWorthRefining_sigmas * c.sigma2_m2);
    const bool refine = !is_new() || hash_of(cube) % kRefineTurns == turn;
    if ((c.differs >= least_region() && c.differs > kMuch * c.held) ||
        (refine && c.refinable > c.held / 4 && c.moved2_m2 > worth2_m2))
      out.insert(cube);
  }
  return out;
}

/// The cubes that contain changing pixels: their chunks are sent again in any case.
std::set<Vec3i> Background::cubes_of(const ImageMask& regions) const {
  std::set<Vec3i> out;
  for (std::size_t i = 0; i < models_.size(); ++i) {
    if (!regions.data[i]) continue;
    if (still_.data[i] > 0) out.insert(cube_of(i, still_.data[i]));
    if (models_[i].count > 0) out.insert(cube_of(i, models_[i].mean));
  }
  return out;
}

/// Updates still(). Small changes are included if their cube changes anyway. Returns whether it
/// changed.
bool Background::freeze() {
  const ImageMask regions = regions_to_freeze();
  const std::set<Vec3i> refined = cubes_to_refine(), touched = cubes_of(regions);
  bool changed = false;
  for (std::size_t i = 0; i < models_.size(); ++i) {
    PixelModel& now = models_[i];
    const float was = still_.data[i], mean = now.count > 0 ? now.mean : 0;
    const bool other = differs(i);
    const auto in = [&](const std::set<Vec3i>& cubes) {
      return !cubes.empty() && ((was > 0 && cubes.contains(cube_of(i, was))) ||
                                (mean > 0 && cubes.contains(cube_of(i, mean))));
    };
    if (!regions.data[i] && !(other && in(touched)) && !in(refined)) continue;
    if (!other && now.count < 2 * details_[i].frozen_count) continue;
    changed |= was != mean;
    still_.data[i] = mean;
    details_[i].frozen_count = now.count;
    if (other) now.age = 0, details_[i].change = changes_ + 1;
  }
  changes_ += changed;
  return changed;
}

}  // namespace mr::still
