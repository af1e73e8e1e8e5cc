#include "mr/atlas/clean_plate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "mr/core/parallel.h"

namespace mr {
namespace {

using atlas::CleanPlate;

constexpr int kWidth = 256, kHeight = 144, kColumns = 16, kRows = 9;

/// Wallpaper, at a point.
double painted(int x, int y, int c) {
  return 110 + 40 * std::sin(0.02 * x + c) + 25 * std::sin(0.3 * y) + 15 * ((x / 5 + y / 3) % 2);
}

/// A room before a camera on a tripod.
class Room {
 public:
  double sigma = 4;  ///< levels of noise
  double gain = 1;   ///< of the exposure

  explicit Room(int width = kWidth, int height = kHeight) : shown_(width, height) {
    std::mt19937 random(7);
    std::normal_distribution<float> normal;
    for (float& n : noise_) n = normal(random);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        for (int c = 0; c < 3; ++c)
          shown_.at(x, y)[c] = static_cast<std::uint8_t>(painted(x, y, c));
  }

  void hang(const Rect& r, std::array<int, 3> color) {
    for (int y = r.y; y < r.y + r.height; ++y)
      for (int x = r.x; x < r.x + r.width; ++x)
        for (int c = 0; c < 3; ++c) shown_.at(x, y)[c] = static_cast<std::uint8_t>(color[c]);
  }

  const ImageRgb& truth() const { return shown_; }
  ImageRgb capture() {
    ImageRgb out = shown_;
    for (int y = 0; y < out.height; ++y) {
      std::size_t at = random_();
      std::uint8_t* const row = out.row(y);
      for (int i = 0; i < 3 * out.width; ++i)
        row[i] = static_cast<std::uint8_t>(std::clamp(
            std::floor(row[i] * gain + sigma * noise_[at++ % noise_.size()] + 0.5), 0.0, 255.0));
    }
    return out;
  }

 private:
  ImageRgb shown_;
  std::vector<float> noise_ = std::vector<float>(100'003);
  std::mt19937 random_{3};
};

TileMask all(int columns = kColumns, int rows = kRows) {
  return {CleanPlate::kBlock_px, columns, rows,
          std::vector<std::uint8_t>(static_cast<std::size_t>(columns) * rows, 1)};
}

TileMask all_but(int column, int row) {
  TileMask out = all();
  out.tiles[static_cast<std::size_t>(row) * kColumns + column] = 0;
  return out;
}

void show(CleanPlate& plate, Room& room, int captures, const TileMask& unhidden = all()) {
  for (int i = 0; i < captures; ++i) plate.update(room.capture(), unhidden);
}

/// The largest distance between means over 4x4 pixels, inside a rectangle.
double most_off(const ImageRgb& a, const ImageRgb& b, const Rect& r) {
  double most = 0;
  for (int y0 = r.y; y0 < r.y + r.height; y0 += 4)
    for (int x0 = r.x; x0 < r.x + r.width; x0 += 4)
      for (int c = 0; c < 3; ++c) {
        double sum = 0;
        for (int i = 0; i < 16; ++i)
          sum += a.at(x0 + i % 4, y0 + i / 4)[c] - b.at(x0 + i % 4, y0 + i / 4)[c];
        most = std::max(most, std::abs(sum) / 16);
      }
  return most;
}

const Rect kWhole{0, 0, kWidth, kHeight};

TEST(CleanPlate, IsValidAfterFourCapturesAndBetterAfter32) {
  Room room;
  CleanPlate plate;
  show(plate, room, 3);
  EXPECT_EQ(std::count(plate.valid().tiles.begin(), plate.valid().tiles.end(), 1), 0);
  EXPECT_EQ(plate.picture().at(10, 10)[0], 128);
  EXPECT_TRUE(plate.update(room.capture(), all()));
  EXPECT_EQ(plate.changed_blocks(), std::size_t{kColumns * kRows});
  EXPECT_EQ(plate.valid(), all());
  const double first = most_off(plate.picture(), room.truth(), kWhole);
  EXPECT_LT(first, 3);
  show(plate, room, 28);
  EXPECT_EQ(plate.changed_blocks(), std::size_t{kColumns * kRows});
  EXPECT_LT(most_off(plate.picture(), room.truth(), kWhole), 0.5 * first);
}

TEST(CleanPlate, CopiesNothingOfAStillRoomHoweverNoisy) {
  for (const double sigma : {0.0, 4.0, 9.0}) {
    Room room;
    room.sigma = sigma;
    CleanPlate plate;
    show(plate, room, 40);
    const ImageRgb picture = plate.picture();
    const Vec3f gain = plate.gain();
    for (int i = 0; i < (sigma == 4 ? 1000 : 300); ++i)
      ASSERT_FALSE(plate.update(room.capture(), all())) << "sigma " << sigma << ", capture " << i;
    EXPECT_EQ(plate.changed_blocks(), 0u);
    EXPECT_EQ(plate.picture(), picture);
    EXPECT_EQ(plate.gain(), gain);
  }
}

/// Video coding makes errors that stay until the next key frame makes others, everywhere.
TEST(CleanPlate, KeyFramesOfTheLivePictureCopyNextToNothing) {
  Room room;
  room.sigma = 1;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<double> error;  // of each cell of 4x4 pixels
  CleanPlate plate;
  std::size_t copied = 0;
  for (int i = 0; i < 500; ++i) {
    if (i % 100 == 0) {
      error.clear();
      for (int k = 0; k < kWidth / 4 * kHeight / 4 * 3; ++k) error.push_back(1.4 * normal(random));
    }
    ImageRgb live = room.capture();
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        for (int c = 0; c < 3; ++c) {
          const double e = error[((y / 4) * (kWidth / 4) + x / 4) * 3 + c];
          live.at(x, y)[c] = static_cast<std::uint8_t>(
              std::clamp(std::floor(live.at(x, y)[c] + e + 0.5), 0.0, 255.0));
        }
    plate.update(live, all());
    if (i >= 40) copied += plate.changed_blocks();
  }
  EXPECT_LE(copied, 2u);  // of 144, five times
}

TEST(CleanPlate, APosterThatChangesComesThrough) {
  Room room;
  CleanPlate plate;
  const Rect poster{100, 40, 44, 60};
  room.hang(poster, {200, 60, 60});
  show(plate, room, 50);
  room.hang(poster, {188, 70, 66});
  show(plate, room, 3);
  EXPECT_EQ(plate.changed_blocks(), 0u);
  std::size_t copied = 0;
  for (int i = 3; i < 8; ++i) plate.update(room.capture(), all()), copied += plate.changed_blocks();
  EXPECT_LT(most_off(plate.picture(), room.truth(), poster), 4);
  EXPECT_EQ(copied, 3u * 5);
  // And once more when there are 32 captures of it, of which nothing has flashed by.
  copied = 0;
  for (int i = 8; i < 100; ++i)
    plate.update(room.capture(), all()), copied += plate.changed_blocks();
  EXPECT_EQ(copied, 3u * 5);
  EXPECT_LT(most_off(plate.picture(), room.truth(), poster), 1.5);
}

TEST(CleanPlate, WhatChangesWhileThePlateIsYoungComesThroughAsSoon) {
  Room room;
  CleanPlate plate;
  show(plate, room, 15);
  const Rect poster{100, 40, 44, 60};
  room.hang(poster, {200, 60, 60});
  show(plate, room, 8);
  EXPECT_LT(most_off(plate.picture(), room.truth(), poster), 4);
}

TEST(CleanPlate, ALightThatIsSwitchedComesThrough) {
  Room room;
  CleanPlate plate;
  show(plate, room, 50);
  for (int y = 0; y < kHeight; ++y)  // near a lamp on the right
    for (int x = 0; x < kWidth; ++x)
      room.hang({x, y, 1, 1}, {static_cast<int>(painted(x, y, 0) * (1 + 0.2 * x / kWidth)),
                               static_cast<int>(painted(x, y, 1) * (1 + 0.2 * x / kWidth)),
                               static_cast<int>(painted(x, y, 2) * (1 + 0.1 * x / kWidth))});
  show(plate, room, 12);
  ImageRgb shown = plate.picture();
  const Vec3f gain = plate.gain();
  for (std::size_t i = 0; i < shown.data.size(); ++i)
    shown.data[i] = static_cast<std::uint8_t>(
        std::min(255.f, shown.data[i] * gain[static_cast<int>(i % 3)] + 0.5f));
  EXPECT_LT(most_off(shown, room.truth(), kWhole), 8.5);  // before: 20
}

TEST(CleanPlate, AScreenThatPlaysComesThrough) {
  Room room;
  CleanPlate plate;
  const Rect screen{64, 32, 64, 48};
  show(plate, room, 50);
  for (int i = 0; i < 200; ++i) {
    const int level = 40 + std::abs(300 - 4 * i % 600) / 2;  // two levels a capture
    room.hang(screen, {level, 250 - level, level / 2});
    plate.update(room.capture(), all());
    EXPECT_EQ(plate.picture().at(0, 0)[0] / 8, room.truth().at(0, 0)[0] / 8);
    if (i < 8) continue;
    ASSERT_LT(most_off(plate.picture(), room.truth(), screen), 8 * 2 + 4) << i;
  }
  room.hang(screen, {20, 30, 40});
  show(plate, room, 8);
  EXPECT_LT(most_off(plate.picture(), room.truth(), screen), 4);
}

TEST(CleanPlate, WhatFlashesByChangesNothing) {
  Room room;
  CleanPlate plate;
  show(plate, room, 50);
  Room flash = room;
  flash.hang({64, 32, 32, 32}, {250, 250, 250});
  plate.update(flash.capture(), all());
  for (int i = 0; i < 20; ++i) {
    plate.update(room.capture(), all());
    EXPECT_EQ(plate.changed_blocks(), 0u);
  }
}

TEST(CleanPlate, NobodyIsPaintedOnTheWall) {
  const std::array<int, 3> person{255, 0, 255};
  const auto count_person = [](const ImageRgb& picture) {
    int count = 0;
    for (std::size_t i = 0; i < picture.data.size(); i += 3)
      count += picture.data[i] > 200 && picture.data[i + 1] < 60;
    return count;
  };
  Room room;
  CleanPlate plate;
  Room with_person = room;
  with_person.hang({64, 32, 32, 48}, person);
  TileMask unhidden = all();
  for (int row = 2; row < 5; ++row)
    for (int column = 4; column < 6; ++column) unhidden.tiles[row * kColumns + column] = 0;
  // Hidden from the start; three captures in which the mask does not hide it do not suffice.
  show(plate, with_person, 60, unhidden);
  EXPECT_FALSE(plate.valid().at(4, 2));
  EXPECT_TRUE(plate.valid().at(3, 2));
  for (int i = 0; i < 10; ++i) {
    show(plate, with_person, 3, all());
    show(plate, with_person, 1, unhidden);
  }
  EXPECT_FALSE(plate.valid().at(4, 2));
  EXPECT_EQ(count_person(plate.picture()), 0);
  show(plate, room, 4, all());
  EXPECT_EQ(plate.valid(), all());
  // Hidden later, when the plate is old: it stays as it was.
  show(plate, room, 60, all());
  const ImageRgb before = plate.picture();
  for (int i = 0; i < 10; ++i) {
    show(plate, with_person, 3, all());
    show(plate, with_person, 5, unhidden);
  }
  EXPECT_EQ(plate.picture(), before);
  show(plate, with_person, 10, TileMask{});
  EXPECT_EQ(plate.picture(), before);
  EXPECT_EQ(count_person(plate.picture()), 0);
}

TEST(CleanPlate, WhatIsNotValidContinuesItsNeighbours) {
  Room room;
  room.sigma = 0;
  for (int x = 0; x < kWidth; ++x) room.hang({x, 0, 1, kHeight}, {40 + x / 2, 90, 200 - x / 2});
  CleanPlate plate;
  show(plate, room, 4, all_but(7, 4));
  EXPECT_FALSE(plate.valid().at(7, 4));
  EXPECT_LT(most_off(plate.picture(), room.truth(), {7 * 16, 4 * 16, 16, 16}), 8);
  for (int x = 7 * 16 - 1; x < 8 * 16; ++x)  // no step inside, nor at its border
    EXPECT_LT(std::abs(plate.picture().at(x, 70)[0] - plate.picture().at(x + 1, 70)[0]), 9);
}

TEST(CleanPlate, GainFollowsTheExposureAndThePlateStays) {
  Room room;
  CleanPlate plate;
  show(plate, room, 50);
  const ImageRgb before = plate.picture();
  std::size_t copied = 0;
  for (int i = 0; i < 200; ++i) {  // drifts
    room.gain = 1 + 0.3 * std::sin(0.03 * i);
    plate.update(room.capture(), all());
    copied += plate.changed_blocks();
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(plate.gain()[c] / room.gain, 1, 0.015) << i;
  }
  for (const double jump : {0.6, 1.5, 1.0, 0.3}) {
    room.gain = jump;
    for (int i = 0; i < 4; ++i)
      plate.update(room.capture(), all()), copied += plate.changed_blocks();
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(plate.gain()[c] / jump, 1, 0.015);
    for (int i = 0; i < 40; ++i)
      plate.update(room.capture(), all()), copied += plate.changed_blocks();
  }
  EXPECT_EQ(copied, 0u);
  EXPECT_EQ(plate.picture(), before);
}

TEST(CleanPlate, WhatIsLearntAtAnotherExposureFitsTheRest) {
  Room room;
  CleanPlate plate;
  show(plate, room, 50, all_but(7, 4));
  room.gain = 1.4;
  show(plate, room, 50);
  EXPECT_EQ(plate.valid(), all());
  EXPECT_LT(most_off(plate.picture(), room.truth(), {7 * 16, 4 * 16, 16, 16}), 2.5);
}

TEST(CleanPlate, ClippedAndDarkBlocksDoNotVote) {
  Room room;
  room.hang({0, 0, kWidth, 96}, {253, 253, 253});
  room.hang({0, 96, kWidth, 16}, {4, 4, 4});
  CleanPlate plate;
  show(plate, room, 50);
  room.gain = 1.3;  // two thirds of the picture cannot get any brighter
  show(plate, room, 4);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(plate.gain()[c], 1.3, 0.02);
}

TEST(CleanPlate, PicturesThatEndInsideABlock) {
  Room room(250, 130);
  CleanPlate plate;
  show(plate, room, 40, all());
  EXPECT_EQ(plate.picture().width, 250);
  EXPECT_LT(most_off(plate.picture(), room.truth(), {0, 0, 248, 128}), 1.5);
  EXPECT_EQ(plate.picture().at(249, 129)[0] / 16, room.truth().at(249, 129)[0] / 16);
  show(plate, room, 100, all());
  EXPECT_EQ(plate.changed_blocks(), 0u);
  Room other;  // another camera
  EXPECT_TRUE(plate.update(other.capture(), all()));
  EXPECT_EQ(plate.picture().width, kWidth);
  EXPECT_FALSE(plate.valid().at(0, 0));
}

TEST(CleanPlate, SameBytesOnAnyNumberOfThreads) {
  const auto bytes = [](int threads) {
    Arena arena(threads);
    CleanPlate plate;
    arena.run([&] {
      Room room;
      for (int i = 0; i < 80; ++i) {
        room.gain = i < 40 ? 1 : 1.2;
        if (i == 60) room.hang({30, 30, 50, 50}, {10, 200, 90});
        plate.update(room.capture(), all_but(i % kColumns, i % kRows));
      }
    });
    return std::pair(plate.picture(), plate.gain());
  };
  EXPECT_EQ(bytes(1), bytes(8));
}

}  // namespace
}  // namespace mr
