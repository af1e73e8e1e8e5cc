#include "mr/kit/video_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "core/temp_dir.h"
#include "mr/core/file.h"
#include "support/video_files.h"

namespace mr::kit {
namespace {

using namespace std::chrono_literals;
using test::TempDir;
using test::VideoKind;
using test::write_video;
using testing::HasSubstr;

constexpr int kPictures = 20;

/// Coloured areas, large enough for any subsampling; the first one's grey level is the number.
ImageRgb numbered(int width, int height, int number) {
  constexpr std::uint8_t kColors[3][3] = {{200, 40, 40}, {40, 180, 60}, {60, 60, 220}};
  ImageRgb out(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c)
        out.at(x, y)[c] = y < height / 2 ? static_cast<std::uint8_t>(30 + 10 * number)
                                         : kColors[3 * x / width][c];
  return out;
}

std::vector<ImageRgb> clip(int width = 96, int height = 48, int count = kPictures) {
  std::vector<ImageRgb> out;
  for (int i = 0; i < count; ++i) out.push_back(numbered(width, height, i));
  return out;
}

int number_of(const ImageRgb& image) {
  return static_cast<int>(
      std::lround((image.at(image.width / 4, image.height / 4)[1] - 30) / 10.0));
}

VideoFile opened(const std::filesystem::path& file) {
  auto video = VideoFile::open(file);
  EXPECT_TRUE(video) << video.error().message;
  return std::move(*video);
}

std::vector<std::byte> file_bytes(const std::string& text) {
  const auto* first = reinterpret_cast<const std::byte*>(text.data());
  return {first, first + text.size()};
}

std::string text_of(const std::filesystem::path& file) {
  const auto bytes = read_file(file);
  return {reinterpret_cast<const char*>(bytes->data()), bytes->size()};
}

/// The largest difference in the middle of each area.
int color_error(const ImageRgb& a, const ImageRgb& b) {
  int out = 0;
  for (const int y : {a.height / 4, 3 * a.height / 4})
    for (const int x : {a.width / 6, a.width / 2, 5 * a.width / 6})
      for (int c = 0; c < 3; ++c) out = std::max(out, std::abs(a.at(x, y)[c] - b.at(x, y)[c]));
  return out;
}

TEST(VideoFile, EveryContainerAndCodecGivesItsPicturesInOrderAndInTime) {
  const TempDir dir;
  const auto pictures = clip();
  for (const auto& [container, encoder, pixels] : {std::tuple{"mp4", "libx264", "yuv420p"},
                                                   {"mov", "libx264", "yuv420p"},
                                                   {"matroska", "libx264", "yuv420p"},
                                                   {"mp4", "libx265", "yuv420p"},
                                                   {"matroska", "libvpx-vp9", "yuv420p"},
                                                   {"mov", "mjpeg", "yuvj422p"}}) {
    if (!test::has_encoder(encoder)) continue;
    VideoKind kind{.container = container, .encoder = encoder, .pixels = pixels};
    if (kind.encoder == "mjpeg") kind.bt709 = false, kind.full_range = true;
    write_video(dir / "a", pictures, kind);
    VideoFile video = opened(dir / "a");
    SCOPED_TRACE(std::string(container) + " " + encoder);
    EXPECT_EQ(video.info().width, 96);
    EXPECT_EQ(video.info().height, 48);
    EXPECT_NEAR(video.info().frames_per_s, 30, 0.1);
    EXPECT_NEAR(std::chrono::duration<double>(video.info().duration).count(), kPictures / 30.0,
                0.04);
    for (int i = 0; i < kPictures; ++i) {
      const auto got = video.next();
      ASSERT_TRUE(got) << got.error().message;
      ASSERT_TRUE(got->has_value()) << i;
      EXPECT_EQ(number_of((*got)->image), i);
      EXPECT_LE(color_error((*got)->image, pictures[static_cast<std::size_t>(i)]), 6) << i;
      const double time_s =
          std::chrono::duration<double>((*got)->time - video.info().start).count();
      EXPECT_NEAR(time_s, i / 30.0, 0.0011);  // Matroska counts milliseconds
    }
    for (int more = 0; more < 2; ++more) {
      const auto end = video.next();
      ASSERT_TRUE(end);
      EXPECT_FALSE(end->has_value());
    }
  }
}

TEST(VideoFile, MatrixRangeAndDepthAreTheStreamsOwn) {
  const TempDir dir;
  const auto pictures = clip(96, 48, 2);
  struct Case {
    const char *encoder, *pixels;
    bool bt709, full_range, says;
  };
  for (const Case& c : {Case{"libx264", "yuv420p", false, false, true},
                        {"libx264", "yuv420p", true, true, true},
                        {"libx264", "yuv420p", false, true, true},
                        {"libx264", "yuv420p", false, false, false},  // small: BT.601
                        {"libx264", "yuv422p", true, false, true},
                        {"libx264", "yuv444p", true, false, true},
                        {"libx264", "nv12", true, false, true},
                        {"libx264", "yuv420p10le", true, false, true},
                        {"libx264", "yuv422p10le", false, false, true},
                        {"libx265", "yuv420p10le", true, false, true}}) {
    if (!test::has_encoder(c.encoder)) continue;
    write_video(dir / "a.mp4", pictures,
                {.encoder = c.encoder,
                 .pixels = c.pixels,
                 .bt709 = c.bt709,
                 .full_range = c.full_range,
                 .says_color = c.says});
    const auto got = opened(dir / "a.mp4").next();
    ASSERT_TRUE(got && got->has_value());
    EXPECT_LE(color_error((*got)->image, pictures[0]), 6)
        << c.encoder << " " << c.pixels << " " << c.bt709 << c.full_range << c.says;
  }
}

TEST(VideoFile, LargePicturesWithoutAStatementAreBt709) {
  const TempDir dir;
  const auto pictures = clip(1280, 640, 1);
  write_video(dir / "a.mp4", pictures, {.says_color = false});
  const auto got = opened(dir / "a.mp4").next();
  ASSERT_TRUE(got && got->has_value());
  EXPECT_LE(color_error((*got)->image, pictures[0]), 6);
}

TEST(VideoFile, ReadingTwiceGivesTheSameBytes) {
  const TempDir dir;
  write_video(dir / "a.mp4", clip(), {});
  VideoFile first = opened(dir / "a.mp4"), second = opened(dir / "a.mp4");
  for (int i = 0; i < kPictures; ++i) {
    const auto a = first.next(), b = second.next();
    ASSERT_TRUE(a && b && a->has_value() && b->has_value());
    EXPECT_EQ((*a)->image, (*b)->image);
  }
}

TEST(VideoFile, SeekGivesTheFirstPictureAtOrAfterATime) {
  const TempDir dir;
  const auto pictures = clip();
  for (const char* container : {"mp4", "matroska"}) {
    write_video(dir / "a", pictures, {.container = container});
    VideoFile video = opened(dir / "a");
    const Duration start = video.info().start;
    for (const int number : {7, 0, 19, 12, 13, 3}) {
      ASSERT_TRUE(video.seek(start + number * 33'333us - 5ms).ok());
      for (int i = number; i < std::min(number + 3, kPictures); ++i) {
        const auto got = video.next();
        ASSERT_TRUE(got && got->has_value()) << container << number;
        EXPECT_EQ(number_of((*got)->image), i) << container;
      }
    }
    ASSERT_TRUE(video.seek(start + 10s).ok());
    const auto end = video.next();
    ASSERT_TRUE(end);
    EXPECT_FALSE(end->has_value());
    ASSERT_TRUE(video.seek(-5s).ok());
    const auto first = video.next();
    ASSERT_TRUE(first && first->has_value());
    EXPECT_EQ(number_of((*first)->image), 0);
  }
}

TEST(VideoFile, SphericalVideoV2StatesPoseAndCrop) {
  const TempDir dir;
  for (const char* container : {"mp4", "matroska"}) {
    write_video(dir / "a", clip(96, 48, 2),
                {.container = container,
                 .sphere = test::SphericalPose{.yaw_deg = 30, .pitch_deg = -12.5, .roll_deg = 3}});
    const PanoramaInfo whole = opened(dir / "a").info().panorama;
    EXPECT_TRUE(whole.equirectangular()) << container;
    EXPECT_NEAR(whole.heading_deg, 30, 1e-4);
    EXPECT_NEAR(whole.pitch_deg, -12.5, 1e-4);
    EXPECT_NEAR(whole.roll_deg, 3, 1e-4);
    EXPECT_FALSE(whole.cropped());
    // 96 columns are what a quarter on the left leaves of 128; 48 rows of 64.
    write_video(dir / "a", clip(96, 48, 2),
                {.container = container,
                 .sphere = test::SphericalPose{.left = 0.25, .top = 0.125, .bottom = 0.125}});
    const PanoramaInfo part = opened(dir / "a").info().panorama;
    EXPECT_TRUE(part.equirectangular());
    EXPECT_EQ(part.full_width, 128) << container;
    EXPECT_EQ(part.full_height, 64);
    EXPECT_EQ(part.crop, (Rect{32, 8, 96, 48}));
  }
}

TEST(VideoFile, SphericalVideoV1StatesTheProjectionButNoPose) {
  const TempDir dir;
  write_video(dir / "a.mp4", clip(96, 48, 2), {});
  EXPECT_EQ(opened(dir / "a.mp4").info().panorama, PanoramaInfo{});
  const std::string xml =
      "<?xml version=\"1.0\"?><rdf:SphericalVideo xmlns:GSpherical="
      "'http://ns.google.com/videos/1.0/spherical/'><GSpherical:Spherical>true"
      "</GSpherical:Spherical><GSpherical:Stitched>true</GSpherical:Stitched>"
      "<GSpherical:StitchingSoftware>x</GSpherical:StitchingSoftware>"
      "<GSpherical:ProjectionType>equirectangular</GSpherical:ProjectionType>"
      "<GSpherical:InitialViewHeadingDegrees>90</GSpherical:InitialViewHeadingDegrees>"
      "</rdf:SphericalVideo>";
  auto video =
      VideoFile::open(file_bytes(test::with_spherical_v1(text_of(dir / "a.mp4"), xml)), "v1");
  ASSERT_TRUE(video) << video.error().message;
  EXPECT_TRUE(video->info().panorama.equirectangular());
  EXPECT_EQ(video->info().panorama.heading_deg, 0);
  const auto got = video->next();
  ASSERT_TRUE(got && got->has_value());
}

TEST(VideoFile, RotationAndTimeOfRecordingAreReported) {
  const TempDir dir;
  const auto pictures = clip(96, 48, 2);
  write_video(dir / "a.mp4", pictures,
              {.rotation_deg = 90, .creation_time = "2023-05-06T07:08:09.000000Z"});
  VideoFile video = opened(dir / "a.mp4");
  EXPECT_EQ(video.info().rotation_deg, 90);
  using namespace std::chrono;
  ASSERT_TRUE(video.info().recorded_at.has_value());
  EXPECT_EQ(*video.info().recorded_at, TimePoint(sys_days(2023y / May / 6) + 7h + 8min + 9s));
  const auto got = video.next();
  ASSERT_TRUE(got && got->has_value());
  EXPECT_LE(color_error((*got)->image, pictures[0]), 6);  // not turned
  write_video(dir / "b.mp4", pictures, {});
  EXPECT_EQ(opened(dir / "b.mp4").info().rotation_deg, 0);
  EXPECT_FALSE(opened(dir / "b.mp4").info().recorded_at.has_value());
}

TEST(VideoFile, WhatIsNoVideoSaysSoInOneLine) {
  const TempDir dir;
  write_video(dir / "whole.mp4", clip(96, 48, 4), {});
  const std::string whole = text_of(dir / "whole.mp4");
  const auto message = [](const std::filesystem::path& file) {
    const auto video = VideoFile::open(file);
    EXPECT_FALSE(video);
    const std::string out = video ? "" : video.error().message;
    EXPECT_THAT(out, HasSubstr(file.filename().string()));
    EXPECT_EQ(out.find('\n'), std::string::npos);
    return out;
  };
  EXPECT_THAT(message(dir / "gone.mp4"), HasSubstr("no such file"));
  EXPECT_THAT(message(dir.path()), HasSubstr("no such file"));
  EXPECT_THAT(message(dir.write("note.mp4", "hello, I am no video at all")),
              HasSubstr("not an MP4"));
  message(dir.write("empty.mp4", ""));
  // A recording whose power failed: the index at the end is missing.
  EXPECT_THAT(message(dir.write("cut.mp4", whole.substr(0, whole.size() / 2))),
              HasSubstr("cut off before its index"));
  test::write_sound_only(dir / "sound.mp4");
  EXPECT_THAT(message(dir / "sound.mp4"), HasSubstr("no video stream"));
  // Kinds that can point to other files.
  message(dir.write("list.m3u8", "#EXTM3U\n#EXTINF:1,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n"));
  message(dir.write("list.txt", "ffconcat version 1.0\nfile whole.mp4\n"));
}

TEST(VideoFile, ACutFileGivesItsPicturesAndThenAnError) {
  const TempDir dir;
  for (const char* container : {"mp4", "matroska"}) {
    write_video(dir / "whole", clip(), {.container = container, .index_first = true});
    const std::string whole = text_of(dir / "whole");
    const auto file = dir.write("cut", whole.substr(0, whole.size() * 2 / 3));
    VideoFile video = opened(file);
    int pictures = 0, errors = 0;
    for (int i = 0; i < 3 * kPictures; ++i) {
      const auto got = video.next();
      if (got && !got->has_value()) break;
      if (!got) {
        EXPECT_THAT(got.error().message, HasSubstr("truncated")) << container;
      }
      got ? ++pictures : ++errors;
    }
    EXPECT_GT(pictures, 3) << container;
    EXPECT_LT(pictures, kPictures);
    EXPECT_EQ(errors, 1) << container;
    EXPECT_FALSE((*video.next()).has_value());
  }
}

/// Damage in the middle of the coded data: wrong pictures are left out, later ones come again.
TEST(VideoFile, DamageIsReportedAndHealsAtTheNextKeyFrame) {
  const TempDir dir;
  const auto pictures = clip(96, 48, 40);
  write_video(dir / "a.mp4", pictures, {.key_frame_every = 5, .index_first = true});
  std::string bytes = text_of(dir / "a.mp4");
  const std::size_t data = bytes.find("mdat") + 4;
  for (std::size_t i = data + (bytes.size() - data) / 3; i < data + (bytes.size() - data) / 3 + 300;
       ++i)
    bytes[i] = static_cast<char>(i * 2654435761u >> 13);
  VideoFile video = opened(dir.write("bad.mp4", bytes));
  int errors = 0, good = 0, last = -1;
  for (int i = 0; i < 100; ++i) {
    const auto got = video.next();
    if (!got) {
      EXPECT_THAT(got.error().message, HasSubstr("bad.mp4"));
      ++errors;
      continue;
    }
    if (!got->has_value()) break;
    ++good;
    last = static_cast<int>(
        std::lround(std::chrono::duration<double>((*got)->time - video.info().start).count() * 30));
    EXPECT_LE(color_error((*got)->image, pictures[static_cast<std::size_t>(last)]), 30) << last;
  }
  EXPECT_GT(errors, 0);
  EXPECT_GT(good, 15);
  EXPECT_LT(good, 40);
  EXPECT_EQ(last, 39);
}

TEST(VideoFile, AnyChangedByteIsHandled) {
  const TempDir dir;
  write_video(dir / "a.mp4", clip(32, 16, 3), {.index_first = true});
  const std::string whole = text_of(dir / "a.mp4");
  for (std::size_t i = 0; i < whole.size(); i += 5) {
    std::string bad = whole;
    bad[i] = static_cast<char>(bad[i] ^ (i % 2 == 0 ? 0xFF : 0x10));
    auto video = VideoFile::open(file_bytes(bad), "bad");
    for (int n = 0; video && n < 20; ++n) {
      const auto got = video->next();
      if (got && !got->has_value()) break;
    }
  }
}

}  // namespace
}  // namespace mr::kit
