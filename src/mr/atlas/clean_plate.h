#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/vec.h"

namespace mr::atlas {

/// A clean plate (film term: a background picture): one camera's picture of the room without moving
/// people and things (docs/layers.md, Colour). It textures the still surface. It is updated in
/// blocks, only where the room changed, so that a video of it costs almost no bits. One per colour
/// view. Deterministic on any number of threads.
///
/// A 16x16 block becomes valid with the mean of its first four consecutive captures that show only
/// still surface, and is refined once, to the mean of 32. Afterwards it is replaced only when four
/// consecutive captures differ from it by more than noise: that of the camera, estimated per block,
/// and that of video coding, which lasts for seconds and changes everywhere with a key frame,
/// estimated over all blocks. A change of the camera's exposure becomes the gain and replaces no
/// block.
class CleanPlate {
 public:
  static constexpr int kBlock_px = 16;

  /// Processes a capture. `live`: the camera's picture, not empty; a new size resets the plate.
  /// `unhidden`: 16x16 blocks that show only still surface; empty or of another size: none do.
  /// Returns whether picture, validity or gain changed.
  bool update(const ImageRgb& live, const TileMask& unhidden);

  /// The plate at the reference exposure: the camera's values divided by the gain. Invalid blocks
  /// are filled smoothly from their neighbours (push-pull); grey if there is no valid block.
  const ImageRgb& picture() const { return picture_; }
  /// Blocks that have been unhidden for four captures in a row.
  const TileMask& valid() const { return valid_; }
  /// Factors on the picture's sRGB values that give the newest capture's exposure. [1/4, 4]; the
  /// same to the bit while the exposure moves by less than 0.6 %.
  Vec3f gain() const;
  /// Number of blocks that the last update replaced.
  std::size_t changed_blocks() const { return changed_blocks_; }

 private:
  static constexpr int kCellValues = 48;  // 4x4 cells of 4x4 pixels, red green blue
  static constexpr int kBlockValues = kBlock_px * kBlock_px * 3;
  /// A value for each cell and channel; of colours, in sixteenths of a level.
  using Cells = std::array<std::uint16_t, kCellValues>;
  using Pixels = std::array<std::uint8_t, kBlockValues>;
  using Sums = std::array<std::uint16_t, kBlockValues>;  ///< in eighths of a level, gain removed
  using Color = std::array<std::uint8_t, 3>;

  enum class Stage : std::uint8_t {
    collecting,  ///< the first captures
    refining,    ///< valid, averaging up to 32 captures
    checking,    ///< may have changed; decided after four captures
    settled
  };

  struct Block {
    Stage stage = Stage::collecting;
    bool refined = false;                 ///< holds the mean of 32 captures
    bool seen = false;                    ///< unhidden in the last capture
    bool compared = false;                ///< was seen and valid in the last capture
    std::uint8_t captures = 0;            ///< in the sums
    std::uint8_t doubts = 0;              ///< consecutive captures that differ
    std::uint16_t noise = 0;              ///< sum over cells of their frame-to-frame changes
    Cells now{};                          ///< of the newest capture
    std::array<int, 3> shift{};           ///< mean signed difference of its cells, by channel
    int cell_off = 0;                     ///< largest difference of a cell
    int block_off = 0;                    ///< largest |shift| over channels
    int cell_habit = 0, block_habit = 0;  ///< differences that recently caused a copy
    Cells plate{}, brightest{};          ///< of the picture: mean, and brightest pixel of each cell
    std::array<std::uint32_t, 3> sum{};  ///< over the plate's cells
    Color most{};                        ///< brightest value of the picture
  };

  /// Thresholds for a block's difference: of one cell, of its mean, and of its mean together with
  /// those of the blocks around.
  struct Limits {
    int cell = 0, block = 0, around = 0;
  };

  void start(int width, int height);
  void measure(const ImageRgb& live, const TileMask& unhidden);
  bool follow_exposure();
  std::array<std::vector<std::uint16_t>, 3> exposure_votes() const;
  void compare();
  void compare(Block& block) const;
  bool take(std::size_t block, const ImageRgb& live);
  bool next_stage(std::size_t block);
  Limits limits_of(const Block& block) const;
  bool is_off(std::size_t block, int factor) const;
  bool is_off_around(std::size_t block, int limit) const;
  void start_check(std::size_t block);
  void start_sums(std::size_t block);
  void accumulate(std::size_t block, const ImageRgb& live);
  void copy(std::size_t block);
  void fill_invalid();
  bool any_around(const std::vector<std::uint8_t>& blocks, int column, int row) const;
  void fill(int column, int row);
  Pixels pixels_of(const ImageRgb& image, std::size_t block) const;

  ImageRgb picture_;
  TileMask valid_;
  std::array<std::uint16_t, 3> gain_{8192, 8192, 8192};  ///< in 8192ths
  int usual_cell_off_ = 0,
      usual_block_off_ = 0;  ///< recent differences of most blocks (coding noise)
  std::size_t changed_blocks_ = 0;
  std::uint64_t captures_ = 0;
  std::vector<Block> blocks_;
  std::vector<Sums> sums_;
  std::vector<Color> fill_colors_;  ///< [blocks] colour at the centre, with hysteresis
};

}  // namespace mr::atlas
