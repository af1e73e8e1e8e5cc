#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "mr/atlas/clean_plate.h"
#include "mr/atlas/color_gain.h"
#include "mr/atlas/layout.h"
#include "mr/codec/control.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/node/input_synchronizer.h"
#include "mr/node/texture_stream.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// The root's pictures (paper 3.3; docs/layers.md, Colour): one atlas of what moves, stream 0,
/// with a tile for each view; and where there is a still surface one of plates, stream 1. Beside
/// plates a live tile shows only a window of its view. A picture that did not change is not coded
/// again.
class RootAtlas {
 public:
  static constexpr StreamId kLiveStream{0}, kPlateStream{1};

  /// What the pictures of one tick follow from. Views as the children have them, poses corrected.
  struct Tick {
    const CaptureSet& captures;
    const std::vector<View>& views;
    const std::vector<SourceInfo>& sources;
  };

  /// The part of a camera picture that a live tile shows. It moves in steps; its size, another one
  /// of which takes a key frame, grows by more than it must and shrinks late, where that is worth
  /// it.
  struct Window {
    struct Size {
      int width = 0, height = 0;
    };
    Rect rect;
    Size lately;    ///< the most that was needed since the last look back
    Size before;    ///< and between the two before it
    int ticks = 0;  ///< in which something moved

    Rect follow(const Rect& wanted, const Rect& whole);
  };

  /// What is kept from tick to tick, but for how far the streams are.
  struct Memory {
    std::map<ViewId, atlas::CleanPlate> plates;
    atlas::ColorBalance balance;
    std::map<ViewId, Window> windows;
  };

  /// All that the pictures of one tick follow from, beside the streams' own past.
  struct Drawing {
    const RootAtlas& atlas;  ///< its plates are up to date
    Tick tick;
    const Mesh& moving;
    const Mesh* still;  ///< null: there is none
    float error_m;
  };

  /// The scene must outlive this.
  explicit RootAtlas(const Scene& scene);

  /// Brings the plates up to date. Blocks in which the view's own sensor sees something move stay
  /// as they were; so do those beyond its depth picture into which `moving` falls.
  void update_plates(const Tick& tick, const Mesh& moving);

  /// Which blocks of their pictures the plates are good for; by view.
  std::map<ViewId, TileMask> valid() const;
  /// How many of them, of all views.
  std::size_t valid_blocks() const;

  /// Labels were chosen from the plates as they are: the next packet brings them.
  void bring_plates() { plates_due_ = true; }

  Memory memory() const { return {plates_, balance_, windows_}; }
  /// Goes on from what another one kept.
  void recall(Memory memory);

  /// Adds views and texture units to a packet. `moving`, and `still` where there is one: what they
  /// texture, labelled; `error_m`: of their geometry.
  Status compose(const Tick& tick, const Mesh& moving, const Mesh* still, float error_m,
                 Packet& packet);

  /// Notes who waits for key frames. Any thread.
  void answer(const codec::Control& request);

 private:
  using Children = std::map<ViewId, View>;
  using Used = std::map<ViewId, ImageMask>;
  /// Blocks of a view that its sensor's depth picture sees, and where both cameras were.
  struct Seen {
    View view;
    Camera depth_camera;
    Pose T_world_depth;
    TileMask blocks;
  };

  const TileMask& seen_by_depth(const View& view, const SourceInfo& source);
  bool are_plates_due(std::uint32_t layout);
  Status arrange(const std::vector<View>& views, double scale, atlas::Layout& layout) const;
  std::vector<View> windows(const std::vector<View>& views, const Used& used);
  Used used_pixels(const Tick& tick, const Mesh& shown, float error_m) const;
  void add_views(bool with_plates, Packet& packet) const;
  ImageRgb draw_live(const Children& children, const atlas::Pictures& pictures, const Used& used);
  Status add_plates(const Tick& tick, const Children& children, Packet& packet);
  Status add_unit(TextureStream& stream, int qp, std::uint32_t layout, ImageRgb picture,
                  ImageRgb& last, Packet& packet);

  const Scene* scene_;
  atlas::Layout live_layout_, plate_layout_;
  std::map<ViewId, Window> windows_;
  std::map<ViewId, Seen> seen_;
  atlas::ColorBalance balance_;
  std::map<ViewId, atlas::CleanPlate> plates_;
  TextureStream live_, plate_;
  ImageRgb last_live_, last_plate_;  ///< as they were coded
  ImageRgb spare_;                   ///< memory for the next picture
  // Of the atlas of plates: what it was drawn with, and what has come since.
  std::size_t blocks_waiting_ = 0;
  int waited_ = 0;  ///< ticks
  bool plates_due_ = false;
  atlas::Gains plate_gains_;
  std::uint32_t drawn_layout_ = 0;
};

}  // namespace mr::node
