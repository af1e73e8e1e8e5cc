#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/still/connected_components.h"

namespace mr::still {

struct BackgroundConfig {
  Precision precision;    ///< of the sensor; the actual noise may be up to 4 times as large
  double fps = 30;        ///< captures per second
  double after_s = 5;     ///< seconds after which an object that stopped becomes background
  double chunk_m = 1.28;  ///< edge of the cubes by which still() is refined
  double voxel_m = 0.01;  ///< of fusion; limits what differences are refined
};

/// The segmentation of one capture.
struct BackgroundUpdate {
  ImageMask moving;            ///< [H, W] foreground: must be reconstructed from this capture
  ImageMask foreign;           ///< [H, W] the part of `moving` known not to be background
  ImageMask confirmed;         ///< [H, W] pixels whose depth agrees with still()
  bool still_changed = false;  ///< Background::still() has changed
  bool was_reset = false;      ///< the model was reset: the camera was moved
};

/// Background subtraction for the depth pictures of a static sensor (docs/layers.md). The
/// background model of a pixel is the depth of the permanent surface (base), learnt from captures
/// that agree, and that of an object that stopped in front of it ("absorbed" into the background).
/// Time is counted in captures, without a clock, so the same captures give the same bytes. The
/// model needs every capture, also those that are not reconstructed. The states of a pixel:
///
///   unknown ──8 captures agree (the first 40 captures; just uncovered), 60 otherwise──▶ base
///   base ──5 farther captures agree, 30 pixels together──▶ unknown, to be learnt again
///   base ──nearer for after_s──▶ absorbed in front of it ──moves again──▶ base
///   unknown ──16 captures without depth, nothing moves──▶ blank: unmeasurable, treated as far
///   blank ──depth agrees for after_s──▶ absorbed in front of it
///   base ──no depth for long, nothing moves──▶ blank: the object there is gone
///   blank ──8 captures agree with the former base──▶ base
///
/// `still()` is a frozen copy of the model: its pixels change only in regions that appeared or
/// disappeared or, seldom, all together in a cube, so that the chunks of the still surface rarely
/// change.
class Background {
 public:
  /// For an undistorted depth camera that does not move.
  Background(const Camera& camera, const Pose& T_world_camera, const BackgroundConfig& config);

  static constexpr std::uint32_t kAll = 0xFFFFFFFFu;
  /// Learns from a capture and segments it. `depth`: as measured (not filtered), of the camera's
  /// size. `shown`: of still() so many changes are shown (changes()); only their pixels are handed
  /// over from the moving surface to the still one. 0: the capture only serves for learning.
  /// Parallel; the same result on any number of threads.
  BackgroundUpdate update(const ImageDepth& depth, std::uint32_t shown = kAll);

  /// Forgets the model.
  void reset();

  /// Depth of the background, 0 where it is unknown.
  const ImageDepth& still() const { return still_; }
  /// How often that has changed.
  std::uint32_t changes() const { return changes_; }

  /// Noise of the depth as a multiple of `precision`, 1 .. 4, estimated from the 30th percentile of
  /// the changes between captures.
  float noise() const { return noise_; }
  std::uint64_t captures() const { return captures_; }
  /// Whether the model is in its first captures and mostly unknown.
  bool is_new() const;

 private:
  /// A surface seen by one pixel: the running mean of `count` depths.
  struct Surface {
    float mean = 0;
    std::uint16_t count = 0;  ///< 0: none
  };
  /// The state of a pixel: the background, or the object absorbed in front of it. Compact, as every
  /// capture reads the models of all pixels.
  struct PixelModel {
    float mean = 0;
    std::uint16_t count = 0;  ///< readings in the mean; 0: unknown or blank
    /// Known: captures that agree since still_ has this depth, up to kHandOver. Unknown: captures
    /// in which nothing was learnt, up to kRestless.
    std::uint8_t age = 0;
    bool is_absorbed : 1 = false;
    bool has_candidate : 1 = false;
    bool is_farther : 1 = false;     ///< the candidate lies behind the model
    bool was_uncovered : 1 = false;  ///< unknown: an object in front has just left
    bool was_missed : 1 = false;     ///< unknown: the last reading disagreed
    bool is_blank : 1 = false;       ///< the background has no measurable depth
    bool is_doubted : 1 = false;     ///< PixelModelDetail::doubt is not 0
  };
  /// State that only some pixels use.
  struct PixelModelDetail {
    Surface base;              ///< the background behind an absorbed object; blank: the former base
    Surface candidate;         ///< recent depths that agree with each other but not with the model
    std::uint16_t region = 0;  ///< of an absorbed object: index into regions_
    std::uint16_t frozen_count = 0;  ///< readings in the mean that still_ holds
    std::uint32_t change = 0;        ///< by which still_ got this depth, as changes() counts them
    /// Recent captures without depth and without motion, minus kAgainstDoubt for each valid depth.
    std::uint16_t doubt = 0;
  };
  struct AbsorbedRegion {
    std::uint32_t pixels = 0;
    std::uint64_t since = 0;  ///< number of the capture
  };
  enum class Reading : std::uint8_t { none, agrees, nearer, farther, unknown };

  template <typename Row>
  void for_each_row(const Row& row) const;
  void measure_noise(const ImageDepth& depth);
  void read_pixels(const ImageDepth& depth);
  void update_expected_readings(double pixels);
  Reading read(float depth, PixelModel& known, PixelModelDetail& detail) const;
  void note_candidate(float depth, bool farther, PixelModel& known, PixelModelDetail& detail) const;
  static void forget(PixelModel& known, PixelModelDetail& detail);
  static void trust(PixelModel& known, PixelModelDetail& detail);
  template <typename Fits>
  std::optional<ConnectedComponents> candidates(int beside, int sure, const Fits& fits) const;
  void forget_contradicted();
  bool is_as_before(const PixelModel& known, const PixelModelDetail& detail) const;
  void count_missing_readings(const ImageMask& moving);
  void doubt(PixelModel& known, PixelModelDetail& detail) const;
  void count_absorbed();
  std::uint16_t new_region();
  void absorb_what_stopped();
  void release_absorbed_that_moves();
  bool camera_has_moved();
  bool is_slightly_nearer(const ImageDepth& depth, int x, int y) const;
  bool is_shown(std::size_t pixel) const;
  bool is_mixed(int x, int y) const;
  ImageMask moving_pixels(const ImageDepth& depth, ImageMask& foreign) const;
  ImageMask confirmed_pixels(const ImageDepth& depth, const ImageMask& moving) const;
  bool differs(std::size_t pixel) const;
  ImageMask regions_to_freeze() const;
  std::set<Vec3i> cubes_to_refine() const;
  std::set<Vec3i> cubes_of(const ImageMask& regions) const;
  bool freeze();

  float sigma_m(float depth) const;
  float band_m(float depth) const;
  double least_region() const;
  int captures_to_learn(const PixelModel& known) const;
  Vec3i cube_of(std::size_t pixel, float depth) const;

  BackgroundConfig config_;
  int width_, height_;
  int after_captures_;
  std::vector<Vec3f> rays_;  ///< [H·W] world direction per unit of depth
  Vec3f eye_;
  std::vector<PixelModel> models_;         ///< [H·W]
  std::vector<PixelModelDetail> details_;  ///< [H·W]
  std::vector<Reading> readings_;          ///< [H·W] of this capture
  ImageDepth still_, previous_;
  std::vector<AbsorbedRegion> regions_;  ///< [id], 0: none
  std::uint64_t captures_ = 0;
  int pushed_for_ = 0;  ///< consecutive captures in which most pixels disagreed
  std::uint32_t changes_ = 0;
  std::uint32_t shown_ = kAll;  ///< of the changes, as of the current capture
  float noise_ = 1;
  // Of the current capture:
  bool any_contradicted_ = false, any_stopped_ = false;  ///< pixels
  bool drops_out_ = false;   ///< a dropout: far fewer valid pixels than usual
  double usually_read_ = 0;  ///< valid pixels, slow running mean
};

}  // namespace mr::still
