#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "mr/atlas/color_gain.h"
#include "mr/atlas/layout.h"
#include "mr/atlas/plate.h"
#include "mr/codec/request.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/core/scene.h"
#include "mr/node/gatherer.h"
#include "mr/node/texture_stream.h"

namespace mr::node {

/// The root's pictures (paper 3.3; DESIGN section 9, Colour): one atlas of what moves, stream 0,
/// with a tile for each view; and where there is a still surface one of plates, stream 1. Beside
/// plates a live tile shows only a window of its view. A picture that did not change is not coded
/// again.
class RootAtlas {
 public:
  static constexpr std::uint32_t kLiveStream = 0, kPlateStream = 1;

  /// What the pictures of one tick follow from. Views as the children have them, poses corrected.
  struct Tick {
    const Gathered& gathered;
    const std::vector<View>& views;
    const std::vector<SourceInfo>& sources;
  };

  /// What is kept from tick to tick, but for how far the streams are.
  struct Memory {
    std::map<ViewId, atlas::Plate> plates;
    atlas::ColorBalance balance;
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

  Memory memory() const { return {plates_, balance_}; }
  /// Goes on from what another one kept.
  void recall(Memory memory);

  /// Adds views and texture units to a packet. `moving`, and `still` where there is one: what they
  /// texture, labelled; `error_m`: of their geometry.
  Status compose(const Tick& tick, const Mesh& moving, const Mesh* still, float error_m,
                 Packet& packet);

  /// Notes who waits for key frames. Any thread.
  void answer(const codec::Request& request);

 private:
  using Children = std::map<ViewId, View>;
  using Used = std::map<ViewId, ImageMask>;

  /// The part of a camera picture that a live tile shows.
  struct Window {
    Rect rect;
    int small_for = 0;  ///< ticks in which much less would have done

    Rect follow(const Rect& wanted, const Rect& whole);
  };

  Status arrange(const std::vector<View>& views, atlas::Layout& layout) const;
  std::vector<View> windows(const std::vector<View>& views, const Used& used);
  Used used_pixels(const Tick& tick, const Mesh& shown, float error_m) const;
  void add_views(bool with_plates, Packet& packet) const;
  ImageRgb draw_live(const Children& children, const atlas::Pictures& pictures,
                     const Used& used) const;
  Status add_plates(const Tick& tick, const Children& children, Packet& packet);
  Status add_unit(TextureStream& stream, std::uint32_t layout, ImageRgb picture, ImageRgb& last,
                  Packet& packet);

  const Scene* scene_;
  atlas::Layout live_layout_, plate_layout_;
  std::map<ViewId, Window> windows_;
  atlas::ColorBalance balance_;
  std::map<ViewId, atlas::Plate> plates_;
  TextureStream live_, plate_;
  ImageRgb last_live_, last_plate_;  ///< as they were coded
  // Of the atlas of plates: whether a block changed since, and what else it was drawn with.
  bool plates_changed_ = false;
  atlas::Gains plate_gains_;
  std::uint32_t drawn_layout_ = 0;
};

}  // namespace mr::node
