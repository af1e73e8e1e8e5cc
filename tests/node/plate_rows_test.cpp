#include "mr/node/plate_rows.h"

#include <gtest/gtest.h>

#include "mr/node/texture_stream.h"

namespace mr::node {
namespace {

constexpr int kStep = PlateRows::kStep, kWidth = 64;

/// Grey, of so many steps; black from `black_from` on.
ImageRgb picture(int steps, int black_from = 1000) {
  ImageRgb out(kWidth, steps * kStep, 90);
  for (int y = black_from * kStep; y < out.height; ++y)
    std::fill_n(out.row(y), 3 * kWidth, std::uint8_t{0});
  return out;
}
ImageRgb changed_at(ImageRgb picture, int row) {
  *picture.at(5, row) = 200;
  return picture;
}
kit::RowBand steps(int first, int end) { return {first * kStep, end * kStep}; }
void expect_band(const std::optional<kit::RowBand>& band, int first, int end) {
  ASSERT_TRUE(band);
  EXPECT_EQ(band->first, first * kStep);
  EXPECT_EQ(band->end, end * kStep);
}

TEST(PlateRows, HaveNothingToRefineBeforeAnythingWasSent) {
  const PlateRows rows;
  EXPECT_EQ(rows.coarser_than(0), 0);
  EXPECT_FALSE(rows.first_coarser_than(0, 1));
}

TEST(PlateRows, AreRefinedFromTheTopUntilNoneIsCoarse) {
  PlateRows rows;
  rows.note_picture({}, picture(10), 40, true);
  EXPECT_NEAR(rows.coarser_than(20), 1, 1e-12);
  EXPECT_EQ(rows.coarser_than(40), 0);
  expect_band(rows.first_coarser_than(20, 0.35), 0, 3);
  rows.note_band(steps(0, 3), 20);
  EXPECT_NEAR(rows.coarser_than(20), 0.7, 1e-12);
  expect_band(rows.first_coarser_than(20, 0.7), 3, 10);
  rows.note_band(steps(3, 10), 20);
  EXPECT_EQ(rows.coarser_than(20), 0);
  EXPECT_FALSE(rows.first_coarser_than(20, 1));
}

TEST(PlateRows, TakeTheWholeRestWhereThatIsJustWhatFits) {
  for (int steps_ = 1; steps_ < 200; ++steps_) {
    PlateRows rows;
    rows.note_picture({}, picture(steps_), 40, true);
    rows.note_band(steps(0, steps_ / 3), 20);
    const double rest = rows.coarser_than(20), whole = 12345.678 * steps_;
    expect_band(rows.first_coarser_than(20, rest * whole / whole), steps_ / 3, steps_);
  }
}

TEST(PlateRows, NotEvenOneFits) {
  PlateRows rows;
  rows.note_picture({}, picture(10), 40, true);
  EXPECT_FALSE(rows.first_coarser_than(20, 0.05));
}

TEST(PlateRows, BlackOnesTakeNothing) {
  PlateRows rows;
  rows.note_picture({}, picture(10, 4), 40, true);
  EXPECT_NEAR(rows.coarser_than(20, steps(0, 2)), 0.5, 1e-12);
  expect_band(rows.first_coarser_than(20, 1), 0, 4);
  rows.note_band(steps(0, 4), 20);
  EXPECT_EQ(rows.coarser_than(20), 0);
}

TEST(PlateRows, WhatDidNotChangeStaysAsFineAsItWas) {
  PlateRows rows;
  const ImageRgb before = picture(10), now = changed_at(before, 5 * kStep + 3);
  rows.note_picture({}, before, 40, true);
  rows.note_band(steps(0, 8), 20);
  rows.note_picture(before, now, 36, false);
  constexpr double kOneBlock = 0.1 / (kWidth / kStep);
  EXPECT_NEAR(rows.coarser_than(20), 0.2 + kOneBlock, 1e-12);
  EXPECT_EQ(rows.coarser_than(36), 0) << "the last two became finer with it";
  expect_band(rows.first_coarser_than(20, 0.1), 5, 6);
  rows.note_picture(before, now, 36, true);
  EXPECT_NEAR(rows.coarser_than(20), 1, 1e-12) << "a key frame is all new";
}

TEST(PlateRows, AnotherSizeIsAllNew) {
  PlateRows rows;
  rows.note_picture({}, picture(10), 20, true);
  rows.note_picture(picture(10), picture(7), 30, false);
  EXPECT_NEAR(rows.coarser_than(20), 1, 1e-12);
}

TEST(PlateRows, TheLastStepMayBeLower) {
  const ImageRgb odd(kWidth, 3 * kStep + 5, 90);
  PlateRows rows;
  rows.note_picture({}, odd, 40, true);
  expect_band(rows.first_coarser_than(20, 1), 0, 4);
  rows.note_picture(odd, changed_at(odd, odd.height - 1), 30, false);
  EXPECT_NEAR(rows.coarser_than(29, steps(3, 4)), 5.0 / odd.height, 1e-12);
}

TEST(TextureStream, ABandComesWithoutAKeyFrameUnlessOneIsDue) {
  Scene scene;
  scene.rate.model = RateConfig::Model::ours;
  TextureStream stream(scene, StreamId{1}, false);
  const ImageRgb shown = picture(8);
  const auto first = stream.encode(shown, 40, 1);
  ASSERT_TRUE(first);
  EXPECT_TRUE(first->key_frame);
  const auto band = stream.refine(shown, 20, 1, steps(0, 4));
  ASSERT_TRUE(band);
  EXPECT_FALSE(band->key_frame);
  stream.ask_key_frame();
  const auto asked = stream.refine(shown, 20, 1, steps(4, 8));
  ASSERT_TRUE(asked);
  EXPECT_TRUE(asked->key_frame) << "with all of the picture";
}

}  // namespace
}  // namespace mr::node
