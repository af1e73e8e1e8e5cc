#include "mr/kit/panorama_info.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/file.h"
#include "mr/kit/image_io.h"
#include "support/jpeg_files.h"
#include "support/pictures.h"
#include "support/shared_data.h"

namespace mr::kit {
namespace {

using testing::HasSubstr;
using Bytes = std::vector<std::byte>;

Bytes text_bytes(const std::string& text) {
  const auto* first = reinterpret_cast<const std::byte*>(text.data());
  return {first, first + text.size()};
}

std::string xmp_segment(const std::string& description) {
  const std::string packet = std::string("http://ns.adobe.com/xap/1.0/\0", 29) +
                             "<?xpacket begin=''?><x:xmpmeta><rdf:RDF><rdf:Description " +
                             description + "</rdf:RDF></x:xmpmeta>";
  return "\xFF\xE1" + test::big_endian(static_cast<std::uint32_t>(packet.size() + 2), 2) + packet;
}

/// A JPEG with a segment behind its first marker.
Bytes jpeg_with(const std::string& segment, int width = 32, int height = 16) {
  Bytes out = test::jpeg_file(test::gradient(width, height), {});
  const Bytes more = text_bytes(segment);
  out.insert(out.begin() + 2, more.begin(), more.end());
  return out;
}

void expect_near(Vec3d a, Vec3d b) {
  EXPECT_LT(length(a - b), 1e-12) << a.x << " " << a.y << " " << a.z;
}

TEST(PanoramaInfo, GpanoAsAttributesAndAsElements) {
  const std::string attributes =
      "xmlns:GPano=\"http://ns.google.com/photos/1.0/panorama/\" "
      "GPano:ProjectionType=\"equirectangular\" GPano:PoseHeadingDegrees = '200.5'\n"
      "GPano:PosePitchDegrees=\"-3\" GPano:PoseRollDegrees=\"+1.25\" "
      "GPano:InitialViewHeadingDegrees=\"77\" GPano:FullPanoWidthPixels=\"4000\" "
      "GPano:FullPanoHeightPixels=\"2000\" GPano:CroppedAreaImageWidthPixels=\"3000\" "
      "GPano:CroppedAreaImageHeightPixels=\"1200\" GPano:CroppedAreaLeftPixels=\"500\" "
      "GPano:CroppedAreaTopPixels=\"400\"/>";
  const std::string elements =
      "><GPano:ProjectionType> equirectangular </GPano:ProjectionType>"
      "<GPano:PoseHeadingDegrees>200.5</GPano:PoseHeadingDegrees>"
      "<GPano:PosePitchDegrees>-3</GPano:PosePitchDegrees>"
      "<GPano:PoseRollDegrees>1.25</GPano:PoseRollDegrees>"
      "<GPano:FullPanoWidthPixels>4000</GPano:FullPanoWidthPixels>"
      "<GPano:FullPanoHeightPixels>2000</GPano:FullPanoHeightPixels>"
      "<GPano:CroppedAreaImageWidthPixels>3000</GPano:CroppedAreaImageWidthPixels>"
      "<GPano:CroppedAreaImageHeightPixels>1200</GPano:CroppedAreaImageHeightPixels>"
      "<GPano:CroppedAreaLeftPixels>500</GPano:CroppedAreaLeftPixels>"
      "<GPano:CroppedAreaTopPixels>400</GPano:CroppedAreaTopPixels></rdf:Description>";
  for (const std::string& text : {attributes, elements}) {
    const auto info = read_panorama_info(jpeg_with(xmp_segment(text)));
    ASSERT_TRUE(info) << info.error().message;
    EXPECT_TRUE(info->equirectangular());
    EXPECT_EQ(info->heading_deg, 200.5);
    EXPECT_EQ(info->pitch_deg, -3);
    EXPECT_EQ(info->roll_deg, 1.25);
    ASSERT_TRUE(info->cropped());
    EXPECT_EQ(info->full_width, 4000);
    EXPECT_EQ(info->full_height, 2000);
    EXPECT_EQ(info->crop, (Rect{500, 400, 3000, 1200}));
  }
}

TEST(PanoramaInfo, AWholeSphereIsNotCropped) {
  const auto info = read_panorama_info(jpeg_with(
      xmp_segment("GPano:ProjectionType=\"equirectangular\" GPano:FullPanoWidthPixels=\"32\" "
                  "GPano:FullPanoHeightPixels=\"16\" GPano:CroppedAreaImageWidthPixels=\"32\" "
                  "GPano:CroppedAreaImageHeightPixels=\"16\" GPano:CroppedAreaLeftPixels=\"0\" "
                  "GPano:CroppedAreaTopPixels=\"0\"/>")));
  ASSERT_TRUE(info);
  EXPECT_TRUE(info->equirectangular());
  EXPECT_FALSE(info->cropped());
}

TEST(PanoramaInfo, NothingIsStatedByOtherFilesAndSegments) {
  const std::string exif = std::string("\xFF\xE1\x00\x0A", 4) + "Exif\0\0GP";
  for (const Bytes& bytes : {test::jpeg_file(test::gradient(32, 16), {}), jpeg_with(exif), Bytes{},
                             text_bytes("\x89PNG GPano:ProjectionType=\"equirectangular\"")}) {
    const auto info = read_panorama_info(bytes);
    ASSERT_TRUE(info);
    EXPECT_EQ(*info, PanoramaInfo{});
  }
  const auto cylinder =
      read_panorama_info(jpeg_with(xmp_segment("GPano:ProjectionType=\"cylindrical\"/>")));
  ASSERT_TRUE(cylinder);
  EXPECT_FALSE(cylinder->equirectangular());
  EXPECT_EQ(cylinder->projection, "cylindrical");
}

TEST(PanoramaInfo, AnyCutOrWrongFieldIsHandled) {
  const Bytes whole = jpeg_with(
      xmp_segment("GPano:ProjectionType=\"equirectangular\" GPano:PoseHeadingDegrees=\"12\"/>"));
  for (std::size_t keep = 0; keep < 240; ++keep)
    EXPECT_TRUE(read_panorama_info(std::span(whole).first(keep))) << keep;
  for (const char* bad : {"abc", "", "1e9", "nan", "inf", "12x", "--3", "361"}) {
    const auto info = read_panorama_info(
        jpeg_with(xmp_segment("GPano:ProjectionType=\"equirectangular\" GPano:PosePitchDegrees=\"" +
                              std::string(bad) + "\"/>")));
    ASSERT_FALSE(info) << bad;
    EXPECT_EQ(info.error().cause, Error::Cause::corrupt);
    EXPECT_THAT(info.error().message, HasSubstr("GPano:PosePitchDegrees"));
  }
}

TEST(PanoramaInfo, EachAngleTurnsThePictureAsItSays) {
  const Vec3d right{1, 0, 0}, down{0, 1, 0}, centre{0, 0, 1};
  const double s = std::sin(std::numbers::pi / 6), c = std::cos(std::numbers::pi / 6);
  expect_near(T_upright_picture({}) * Vec3d{1, 2, 3}, {1, 2, 3});
  // Heading 30 degrees: north (z) by 30 degrees towards the east (x).
  const Pose heading = T_upright_picture({.heading_deg = 30});
  expect_near(heading * centre, {s, 0, c});
  expect_near(heading * down, down);
  // Pitch 30 degrees: the centre lies above the horizon.
  const Pose pitch = T_upright_picture({.pitch_deg = 30});
  expect_near(pitch * centre, {0, -s, c});
  expect_near(pitch * right, right);
  // Roll 30 degrees: the right side is lowered.
  const Pose roll = T_upright_picture({.roll_deg = 30});
  expect_near(roll * right, {c, s, 0});
  expect_near(roll * centre, centre);
}

TEST(PanoramaInfo, RollRotatesTheHorizonCounterclockwiseInThePicture) {
  // GPano's own words. The horizon right of the centre must be seen above the middle row.
  Camera camera;
  camera.model = CameraModel::equirectangular;
  camera.width = 360, camera.height = 180;
  const Pose T_picture_upright = T_upright_picture({.roll_deg = 20}).inverse();
  const Vec3d right_horizon{std::sin(0.5), 0, std::cos(0.5)};
  const auto pixel = project(camera, T_picture_upright * right_horizon);
  ASSERT_TRUE(pixel);
  EXPECT_LT(pixel->y, 89.5 - 5);
}

TEST(PanoramaInfo, AnglesAreAppliedInTheOrderHeadingPitchRoll) {
  // The centre has the stated heading and height whatever the roll is; the roll is about it.
  const PanoramaInfo info{.heading_deg = 100, .pitch_deg = 40, .roll_deg = 70};
  const Pose T = T_upright_picture(info);
  constexpr double kRad = std::numbers::pi / 180;
  expect_near(T * Vec3d{0, 0, 1}, {std::cos(40 * kRad) * std::sin(100 * kRad), -std::sin(40 * kRad),
                                   std::cos(40 * kRad) * std::cos(100 * kRad)});
  // The right side's height is -sin(roll) cos(pitch).
  EXPECT_NEAR((T * Vec3d{1, 0, 0}).y, std::sin(70 * kRad) * std::cos(40 * kRad), 1e-12);
  EXPECT_TRUE(is_rigid(T));
}

TEST(PanoramaInfo, ACropIsPastedWhereItWasTaken) {
  const ImageRgb part = test::gradient(10, 6);
  const PanoramaInfo info{.full_width = 24, .full_height = 12, .crop = {3, 2, 10, 6}};
  const auto whole = uncropped(part, info);
  ASSERT_TRUE(whole) << whole.error().message;
  ASSERT_EQ(whole->width, 24);
  ASSERT_EQ(whole->height, 12);
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 24; ++x)
      for (int c = 0; c < 3; ++c)
        ASSERT_EQ(whole->at(x, y)[c], part.contains(x - 3, y - 2) ? part.at(x - 3, y - 2)[c] : 0);
  EXPECT_EQ(*uncropped(part, {}), part);
}

TEST(PanoramaInfo, ACropThatWasScaledGetsASphereOfItsScale) {
  const PanoramaInfo info{.full_width = 240, .full_height = 120, .crop = {30, 20, 100, 60}};
  const auto whole = uncropped(test::gradient(50, 30), info);
  ASSERT_TRUE(whole) << whole.error().message;
  EXPECT_EQ(whole->width, 120);
  EXPECT_EQ(whole->height, 60);
  EXPECT_EQ(whole->at(15, 10)[2], 200);
  EXPECT_EQ(whole->at(14, 10)[2], 0);
  EXPECT_EQ(whole->at(64, 39)[2], 200);
  EXPECT_EQ(whole->at(65, 39)[2], 0);
}

TEST(PanoramaInfo, CropsThatDoNotFitAreErrors) {
  const ImageRgb part = test::gradient(10, 6);
  for (const PanoramaInfo& bad :
       {PanoramaInfo{.full_width = 24, .full_height = 12, .crop = {15, 2, 10, 6}},
        PanoramaInfo{.full_width = 24, .full_height = 12, .crop = {-1, 2, 10, 6}},
        PanoramaInfo{.full_width = 24, .full_height = 12, .crop = {0, 7, 10, 6}},
        PanoramaInfo{.full_width = 24, .full_height = 20, .crop = {0, 0, 10, 6}},
        PanoramaInfo{.full_width = 24, .full_height = 12, .crop = {0, 0, 10, 10}},
        PanoramaInfo{.full_width = 24, .full_height = 12, .crop = {0, 0, 0, 0}},
        PanoramaInfo{.full_width = 1 << 20, .full_height = 1 << 19, .crop = {0, 0, 10, 6}},
        PanoramaInfo{.full_width = 1 << 20, .full_height = 1 << 19, .crop = {0, 0, 1, 1}}})
    EXPECT_FALSE(uncropped(part, bad));
  EXPECT_FALSE(uncropped({}, {.full_width = 24, .full_height = 12, .crop = {0, 0, 10, 6}}));
}

TEST(PanoramaInfo, TwoToOneIsTheShapeOfASphere) {
  EXPECT_TRUE(is_2_to_1(3840, 1920));
  EXPECT_TRUE(is_2_to_1(5761, 2880));
  EXPECT_FALSE(is_2_to_1(1920, 1080));
  EXPECT_FALSE(is_2_to_1(0, 0));
  EXPECT_FALSE(is_2_to_1(2147483647, 2147483647));
}

TEST(PanoramaInfo, TheRealPanoramaIsWholeAndStatesNothing) {
  const auto file = test::shared_data() / "equirect/examplepano.jpg";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no picture at " << file << " (set MR_DATA)";
  const auto bytes = read_file(file);
  ASSERT_TRUE(bytes);
  const auto info = read_panorama_info(*bytes);
  ASSERT_TRUE(info);
  EXPECT_EQ(*info, PanoramaInfo{});  // it has no XMP
  const auto picture = decode_color(*bytes);
  ASSERT_TRUE(picture) << picture.error().message;
  EXPECT_EQ(picture->width, 4096);
  EXPECT_EQ(picture->height, 2048);
  EXPECT_TRUE(is_2_to_1(picture->width, picture->height));
}

}  // namespace
}  // namespace mr::kit
