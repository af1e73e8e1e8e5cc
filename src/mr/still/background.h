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
  Precision precision;    ///< of the sensor; noise may be up to four times that
  double fps = 30;        ///< captures per second
  double after_s = 5;     ///< what stopped becomes part of the room after so long
  double chunk_m = 1.28;  ///< the still picture is refined cube by cube of this grid
  double voxel_m = 0.01;  ///< what it is fused in: what is small beside that is not worth refining
};

/// What one capture says.
struct BackgroundUpdate {
  ImageMask moving;     ///< [H, W] what must be reconstructed from this very capture
  ImageMask foreign;    ///< [H, W] of those: what does not belong to the room as far as is known
  ImageMask confirmed;  ///< [H, W] the still surface is measured here now
  bool still_changed = false;  ///< Background::still() is another picture than before
  bool was_reset = false;      ///< most of what was known does not hold: the camera was pushed
};

/// What a sensor that stands still knows about the room behind all that moves (DESIGN section 9):
/// for each pixel of its depth picture the distance of the surface that stays, learnt from captures
/// that agree, and what stopped in front of it ("absorbed"). Counts captures, never time, so the
/// same captures give the same bytes. Takes every capture, also those that are not reconstructed.
///
///   unknown ──8 captures agree (the start; just uncovered), 60 or after_s else──▶ base
///   base ──5 farther captures agree, 30 pixels together──▶ unknown, and learnt anew
///   base ──nearer for after_s──▶ absorbed in front of it ──moves again──▶ base
///   unknown ──16 captures without a reading, nothing moves──▶ blank: as if infinitely far
///   blank ──read for after_s──▶ absorbed in front of it
///   base ──no reading for long, nothing moves──▶ blank: who stood there is gone
///   blank ──8 captures agree with what was there before──▶ base
///
/// `still()` is frozen: pixels of it change in regions that came or went, or, seldom, together with
/// the others of their cube, so a chunk of the still surface depends on bits that do not change.
class Background {
 public:
  /// Of an undistorted depth camera that does not move.
  Background(const Camera& camera, const Pose& T_world_camera, const BackgroundConfig& config);

  /// `depth`: as measured (not cleaned), of the camera's size. Parallel; the same result on any
  /// number of threads. `is_sent`: what moves in it is reconstructed and sent; else it serves to
  /// learn, and does not count for the hand-over of pixels from one surface to the other.
  BackgroundUpdate update(const ImageDepth& depth, bool is_sent = true);

  /// Forgets everything.
  void reset();

  /// Mean depth of what stays, 0 where that is not known.
  const ImageDepth& still() const { return still_; }

  /// How much noisier the depth is than `precision` says, from the median change between captures;
  /// 1 .. 4.
  float noise() const { return noise_; }
  std::uint64_t captures() const { return captures_; }
  /// Whether most is still to be learnt.
  bool is_new() const;

 private:
  /// A surface that one pixel sees: the mean of so many readings.
  struct Surface {
    float mean = 0;
    std::uint16_t count = 0;  ///< 0: none
  };
  /// What is known to stay at a pixel: the room, or what was absorbed in front of it. Small, as
  /// every capture reads it.
  struct PixelModel {
    float mean = 0;
    std::uint16_t count = 0;  ///< readings; 0: nothing is known
    /// Captures that agree since still_ holds what is known, up to kHandOver; nothing known:
    /// captures in which nothing was learnt, up to kRestless.
    std::uint8_t age = 0;
    bool is_absorbed : 1 = false;
    bool has_candidate : 1 = false;
    bool is_farther : 1 = false;     ///< the candidate lies behind what is known
    bool was_uncovered : 1 = false;  ///< nothing known: what was in front has just left
    bool was_missed : 1 = false;     ///< nothing known: the last reading disagreed
    bool is_blank : 1 = false;       ///< the room cannot be measured there
    bool is_doubted : 1 = false;     ///< PixelModelDetail::doubt is not 0
  };
  /// What only some pixels have.
  struct PixelModelDetail {
    Surface base;       ///< the room behind what was absorbed; blank: what was known before
    Surface candidate;  ///< readings of late that agree with each other, but not with what is known
    std::uint16_t region = 0;        ///< of what was absorbed: what was absorbed together
    std::uint16_t frozen_count = 0;  ///< readings behind still_
    /// Captures of late without a reading, though nothing moves there, less kAgainstDoubt for each
    /// reading.
    std::uint16_t doubt = 0;
  };
  struct AbsorbedRegion {
    std::uint32_t pixels = 0;
    std::uint64_t since = 0;  ///< capture
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
  int pushed_for_ = 0;   ///< captures in a row in which most disagreed
  bool is_sent_ = true;  ///< the capture at hand
  float noise_ = 1;
  // Of this capture:
  bool any_contradicted_ = false, any_stopped_ = false;  ///< pixels
  bool drops_out_ = false;                               ///< far fewer than usual are read
  double usually_read_ = 0;                              ///< pixels, slow mean
};

}  // namespace mr::still
