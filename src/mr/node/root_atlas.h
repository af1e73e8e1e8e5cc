#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "mr/atlas/clean_plate.h"
#include "mr/atlas/color_sampler.h"
#include "mr/atlas/layout.h"
#include "mr/codec/control.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/node/allowance.h"
#include "mr/node/input_synchronizer.h"
#include "mr/node/plate_rows.h"
#include "mr/node/root_colors.h"
#include "mr/node/texture_painter.h"
#include "mr/node/texture_stream.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// The root's pictures (paper 3.3; docs/layers.md, Colour): the live atlas, stream
/// 0, with a tile for each view, and for a still surface the atlas of clean plates, stream 1. The
/// live tile of a view that has a plate shows only a window of the view. A picture that did not
/// change is not encoded again, but to refine it.
class RootAtlas {
 public:
  static constexpr StreamId kLiveStream{0}, kPlateStream{1};

  /// The inputs of one tick. `views`: of the children, poses corrected.
  struct Tick {
    const CaptureSet& captures;
    const std::vector<View>& views;
    const std::vector<SourceInfo>& sources;
  };

  /// The part of a camera picture that a live tile shows. It stays while it holds what is wanted,
  /// and moves in steps. A change of its size needs a key frame, so the size changes with
  /// hysteresis: it grows with a reserve, and shrinks only after a while and by a substantial
  /// amount.
  struct Window {
    struct Size {
      int width = 0, height = 0;
    };
    Rect rect;
    Size lately;    ///< largest size needed in the current review period
    Size before;    ///< the same in the period before
    int ticks = 0;  ///< with motion; a period has a fixed number

    /// Moves and resizes the window so that it contains `wanted`; `whole`: the camera picture.
    Rect follow(const Rect& wanted, const Rect& whole);
  };

  /// The state kept from tick to tick, without that of the video encoders.
  struct Memory {
    std::map<ViewId, atlas::CleanPlate> plates;
    RootColors colors;
    std::map<ViewId, Window> windows;
  };

  /// All inputs of the pictures of one tick, except the encoders' state.
  struct Drawing {
    const RootAtlas& atlas;  ///< its plates are up to date
    Tick tick;
    const Mesh& moving;
    const Mesh* still;  ///< null: there is none
    float error_m;
  };

  /// The scene must outlive this.
  explicit RootAtlas(const Scene& scene);

  /// Updates the plates. Blocks in which the view's own sensor sees motion are not updated, nor are
  /// blocks outside its depth picture onto which `moving` projects.
  void update_plates(const Tick& tick, const Mesh& moving);

  /// The valid blocks of the plates, by view.
  std::map<ViewId, TileMask> valid() const;
  /// Number of valid blocks, over all views.
  std::size_t valid_blocks() const;

  /// The pictures that view selection compares, after colour correction (as in the last
  /// tick): the live ones, which are shared, and the plates, which are copied.
  atlas::PictureSampler live_colors(const CaptureSet& captures) const;
  atlas::PictureSampler plate_colors(const std::vector<View>& views) const;

  /// Labels were chosen from the current plates: the next packet must contain them.
  void bring_plates() { plates_due_ = true; }

  /// What is known about the views' colours, for reports.
  const RootColors& colors() const { return colors_; }

  Memory memory() const { return {plates_, colors_, windows_}; }
  /// Restores the state of another RootAtlas.
  void recall(Memory memory);

  /// The pictures of one tick before they are encoded. They depend on the plan's scales, not on its
  /// quantisers.
  struct Drawn {
    std::vector<View> views;
    std::vector<AlphaPlane> alpha;
    ImageRgb live;
    std::uint32_t live_layout = 0;
    std::optional<ImageRgb> plates;  ///< where the atlas of plates is to be encoded again
    std::uint32_t plate_layout = 0;
    int plate_qp = 0;
    std::optional<kit::RowBand> plate_band;  ///< only that is refined, of the last picture
    std::size_t plate_blocks = 0;            ///< of the plates, about how many are new, or refined
  };
  /// Draws the pictures for the labelled surfaces `moving` and `still` (null: none). `error_m`:
  /// their geometric error; `sequence`: of the packet. The atlas of plates waits until there are
  /// enough bytes; coarse ones come first, and are refined later up to the plan's quantiser, in as
  /// many bands as it takes.
  Result<Drawn> draw(const Tick& tick, const Mesh& moving, const Mesh* still, float error_m,
                     const CodingPlan& plan, std::uint64_t sequence,
                     const PlateLimits& limits = {});
  /// Whether the live picture would become a key frame.
  bool needs_key_frame(const Drawn& drawn) const {
    return live_.is_key_frame_due(drawn.live.width, drawn.live.height, drawn.live_layout);
  }
  /// Whether, by the last draw(), plates with new content wait to be sent. New labels may refer to
  /// it.
  bool are_plates_held() const { return plates_held_; }
  /// About how many bytes of plates waited in the last draw(), with those that it gave, and how
  /// coarse the plates are without them.
  struct Waiting {
    double bytes = 0;
    double qp = 0, best_qp = 0;  ///< mean over the blocks: what is new counts as the coarsest
  };
  const Waiting& waiting() const { return waiting_; }
  /// Adds views and texture units to a packet, coded by its plan.
  Status encode(Drawn drawn, Packet& packet);

  /// Records requests for key frames. Any thread.
  void answer(const codec::Control& request);

 private:
  using Children = std::map<ViewId, View>;
  using Used = TexturePainter::Used;
  /// Cached: the blocks of a view that its sensor's depth picture covers, for these camera poses.
  struct Seen {
    View view;
    Camera depth_camera;
    Pose T_world_depth;
    TileMask blocks;
  };

  /// What a stream's last unit was made from.
  struct Coded {
    ImageRgb picture;
    int qp = 0;
  };

  const TileMask& seen_by_depth(const View& view, const SourceInfo& source);
  bool are_plates_new(std::uint32_t layout);
  double plate_bytes(std::size_t blocks, int qp) const;
  void note_plate_bytes(std::size_t bytes, std::size_t blocks, int qp);
  struct DuePlates {
    int qp = 0;
    std::size_t blocks = 0;
    std::optional<kit::RowBand> band = {};
  };
  std::optional<DuePlates> due_plates(int best_qp, const PlateLimits& limits);
  std::optional<DuePlates> new_plates(int best_qp, const PlateLimits& limits);
  std::optional<DuePlates> refined_plates(int best_qp, const PlateLimits& limits);
  Status arrange(const std::vector<View>& views, double scale, atlas::Layout& layout) const;
  std::vector<View> windows(const std::vector<View>& views, const Used& used);
  Used used_pixels(const Tick& tick, const Mesh& shown, float error_m) const;
  std::vector<View> shown_views(bool with_plates) const;
  std::vector<AlphaPlane> draw_alpha(const Tick& tick, const Children& children,
                                     const Used& used) const;
  ImageRgb draw_live(const Children& children, const atlas::Pictures& pictures, Used used);
  ImageRgb draw_plates(const Children& children);
  Status add_unit(TextureStream& stream, int qp, std::uint32_t layout, ImageRgb picture,
                  Coded& last, Packet& packet);
  Status add_plates(Drawn& drawn, Packet& packet);
  Status refine_plates(const Drawn& drawn, Packet& packet);

  const Scene* scene_;
  atlas::Layout live_layout_, plate_layout_;
  std::map<ViewId, Window> windows_;
  std::map<ViewId, Seen> seen_;
  RootColors colors_;
  std::map<ViewId, atlas::CleanPlate> plates_;
  TextureStream live_, plate_;
  Coded last_live_, last_plate_;
  ImageRgb spare_;                  ///< reused memory for the next picture
  std::size_t changed_blocks_ = 0;  ///< of the plates, by the last update
  TexturePainter painter_;
  /// The plates as shown, by the stream of the view: corrected and blended; as last drawn.
  atlas::Pictures shown_plates_;
  // The atlas of plates: the colours and layout it was drawn with, and the blocks changed since.
  std::size_t blocks_waiting_ = 0;
  int waited_ = 0;  ///< ticks
  bool plates_due_ = false;
  double block_bytes_ = 32;  ///< of a block of plates, with a usual quantiser; learnt
  bool plates_held_ = false;
  Waiting waiting_;
  PlateRows rows_;  ///< of the newest atlas of plates
  atlas::ColorCorrections plate_colors_;
  std::uint32_t drawn_layout_ = 0;
  std::vector<View> sent_plates_;  ///< the layout of the newest atlas of plates
};

}  // namespace mr::node
