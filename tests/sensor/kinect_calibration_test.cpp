#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "mr/core/file.h"
#include "mr/sensor/azure_kinect/calibration.h"
#include "support/shared_data.h"

namespace mr::sensor {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// The worked example of FORMATS.md 3.6: a user's calibration, and figures that follow from the
// formulas of 3.3 and 3.4 in double precision.
constexpr const char* kDepthParameters =
    "0.49862006306648254, 0.49299359321594238, 0.49295613169670105, 0.49312511086463928, "
    "3.8691997528076172, 2.0663304328918457, 0.086164794862270355, 4.2011380195617676, "
    "3.3314094543457031, 0.50915241241455078, 0, 0, 7.02285033185035E-5, 0.00015635808813385666";
constexpr const char* kColorParameters =
    "0.50041943788528442, 0.51068669557571411, 0.476089745759964, 0.63471859693527222, "
    "0.34417539834976196, -2.8604564666748047, 1.8035205602645874, 0.21697279810905457, "
    "-2.6490097045898437, 1.7056518793106079, 0, 0, -4.4145919673610479E-5, "
    "0.00047436624299734831";
constexpr const char* kColorPose =
    R"({"Rotation": [0.99997377395629883, 0.0072122937999665737, -0.00064296292839571834,
    -0.007122507318854332, 0.99573004245758057, 0.092037834227085114, 0.0013040214544162154,
    -0.0920308455824852, 0.99575531482696533], "Translation": [-0.032023865729570389,
    -0.0021201763302087784, 0.0039135357365012169]})";
constexpr const char* kNoPose = R"({"Rotation": [1,0,0,0,1,0,0,0,1], "Translation": [0,0,0]})";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::string camera_json(const std::string& location, const std::string& parameters,
                        const std::string& radius, const std::string& size,
                        const std::string& pose) {
  return R"({"Intrinsics": {"ModelParameterCount": 14, "ModelParameters": [)" + parameters +
         R"(], "ModelType": "CALIBRATION_LensDistortionModelBrownConrady"}, "Location": )" +
         "\"CALIBRATION_CameraLocation" + location + R"(", "MetricRadius": )" + radius +
         ", \"Rt\": " + pose + ", " + size + "}";
}

std::string depth_json() {
  return camera_json("D0", kDepthParameters, "1.7399997711181641",
                     R"("SensorWidth": 1024, "SensorHeight": 1024)", kNoPose);
}
std::string color_json() {
  return camera_json("PV0", kColorParameters, "0", R"("SensorWidth": 4096, "SensorHeight": 3072)",
                     kColorPose);
}
std::string file_of(const std::string& cameras) {
  return R"({"CalibrationInformation": {"Cameras": [)" + cameras + "]}}";
}
std::string example() { return file_of(depth_json() + ", " + color_json()); }

KinectCalibration parsed(const std::string& json) {
  const auto read = parse_kinect_calibration(json);
  if (read) return *read;
  ADD_FAILURE() << read.error().message;
  return {};
}

std::string failure(const std::string& json) {
  const auto read = parse_kinect_calibration(json);
  EXPECT_FALSE(read);
  return read ? "" : read.error().message;
}

Camera depth_of(const std::string& json, const char* mode) {
  const auto camera = depth_camera(parsed(json), *find_depth_mode(mode));
  EXPECT_TRUE(camera) << camera.error().message;
  return *camera;
}

Camera color_of(const std::string& json, const char* mode) {
  const auto camera = color_camera(parsed(json), *find_color_mode(mode));
  EXPECT_TRUE(camera) << camera.error().message;
  return *camera;
}

void expect_intrinsics(const Camera& c, double cx, double cy, double fx, double fy,
                       double tolerance = 1e-3) {
  EXPECT_NEAR(c.cx, cx, tolerance);
  EXPECT_NEAR(c.cy, cy, tolerance);
  EXPECT_NEAR(c.fx, fx, tolerance);
  EXPECT_NEAR(c.fy, fy, tolerance);
}

TEST(KinectCalibration, EveryModeHasItsIntrinsics) {
  const std::string json = example();
  expect_intrinsics(depth_of(json, "NFOV_2X2BINNED"), 158.7935, 161.9127, 252.3935, 252.4801);
  expect_intrinsics(depth_of(json, "NFOV_UNBINNED"), 318.0869, 324.3254, 504.7871, 504.9601);
  expect_intrinsics(depth_of(json, "WFOV_2X2BINNED"), 254.7935, 251.9127, 252.3935, 252.4801);
  expect_intrinsics(depth_of(json, "WFOV_UNBINNED"), 510.0869, 504.3254, 504.7871, 504.9601);
  expect_intrinsics(depth_of(json, "PASSIVE_IR"), 510.0869, 504.3254, 504.7871, 504.9601);
  expect_intrinsics(color_of(json, "720P"), 640.0369, 369.7592, 609.3949, 609.3299);
  expect_intrinsics(color_of(json, "1080P"), 960.3053, 554.8888, 914.0923, 913.9948);
  expect_intrinsics(color_of(json, "1440P"), 1280.5738, 740.0185, 1218.7897, 1218.6597);
  expect_intrinsics(color_of(json, "1536P"), 1024.3590, 783.9148, 975.0318, 974.9278);
  expect_intrinsics(color_of(json, "2160P"), 1921.1106, 1110.2777, 1828.1846, 1827.9896);
  expect_intrinsics(color_of(json, "3072P"), 2049.2180, 1568.3295, 1950.0636, 1949.8555);
}

TEST(KinectCalibration, TagsNameModes) {
  EXPECT_EQ(find_depth_mode("NFOV_2x2BINNED"), &kinect_depth_modes()[0]);  // as older files write
  EXPECT_EQ(find_depth_mode("wfov_unbinned")->width, 1024);
  EXPECT_EQ(find_depth_mode("OFF"), nullptr);
  EXPECT_EQ(find_depth_mode(""), nullptr);
  EXPECT_EQ(find_color_mode("MJPG_1080P"), &kinect_color_modes()[1]);
  EXPECT_EQ(find_color_mode("bgra_3072p")->height, 3072);
  EXPECT_EQ(find_color_mode("720P"), &kinect_color_modes()[0]);
  EXPECT_EQ(find_color_mode("MJPG_721P"), nullptr);
  EXPECT_EQ(find_color_mode("OFF"), nullptr);
}

TEST(KinectCalibration, ProjectsAndUnprojectsAsWorkedOut) {
  const Camera c = depth_of(example(), "NFOV_UNBINNED");
  const auto expect_pixel = [&](Vec2d ray, Vec2d pixel) {
    const auto at = project(c, {ray.x, ray.y, 1});
    ASSERT_TRUE(at);
    EXPECT_NEAR(at->x, pixel.x, 1e-5);
    EXPECT_NEAR(at->y, pixel.y, 1e-5);
  };
  expect_pixel({0.1, -0.05}, {368.357601, 299.182704});
  expect_pixel({0.5, 0.4}, {541.793935, 503.373118});
  const auto expect_ray = [&](Vec2d pixel, Vec2d ray) {
    const Vec3d at = unproject(c, pixel);
    EXPECT_NEAR(at.x, ray.x, 1e-9);
    EXPECT_NEAR(at.y, ray.y, 1e-9);
  };
  expect_ray({320, 288}, {0.0037960928, -0.0720639611});
  expect_ray({100, 100}, {-0.5010174571, -0.5152231308});
  expect_ray({600, 500}, {0.6613507723, 0.4118995869});
}

TEST(KinectCalibration, DepthPixelsMeetTheirColour) {
  const std::string json = example();
  const Camera depth = depth_of(json, "NFOV_UNBINNED");
  const Camera hd = color_of(json, "MJPG_1080P"), uhd = color_of(json, "2160P");
  const Pose T = T_color_depth(parsed(json));
  const auto expect_color = [&](Vec2d pixel, double z_m, Vec2d in_hd, Vec2d in_uhd,
                                Vec3d point_mm) {
    const Vec3d point = T * (z_m * unproject(depth, pixel));
    EXPECT_LT(length(point * 1000.0 - point_mm), 2e-4);
    const auto a = project(hd, point), b = project(uhd, point);
    ASSERT_TRUE(a && b);
    EXPECT_NEAR(a->x, in_hd.x, 1e-4);
    EXPECT_NEAR(a->y, in_hd.y, 1e-4);
    EXPECT_NEAR(b->x, in_uhd.x, 2e-4);
    EXPECT_NEAR(b->y, in_uhd.y, 2e-4);
  };
  expect_color({320, 288}, 1, {933.6034, 571.3630}, {1867.7068, 1143.2260},
               {-29.3906, 18.1344, 1006.3059});
  expect_color({320, 288}, 2.5, {951.0392, 572.5580}, {1902.5784, 1145.6159},
               {-25.4407, 48.5162, 2509.8945});
  expect_color({100, 100}, 1, {476.2931, 177.2593}, {953.0863, 355.0185},
               {-537.3871, -419.5370, 1046.4319});
  expect_color({600, 500}, 2.5, {1607.5766, 1049.0618}, {3215.6532, 2098.6236},
               {1627.1291, 1241.5502, 2400.6892});
}

/// Within the radius of validity a lens can be inverted.
TEST(KinectCalibration, EveryPixelWithinTheRadiusComesBack) {
  const KinectCalibration calibration = parsed(example());
  for (const KinectMode& mode : kinect_depth_modes()) {
    const auto c = depth_camera(calibration, mode);
    ASSERT_TRUE(c);
    int valid = 0;
    for (int y = 0; y < c->height; y += 7)
      for (int x = 0; x < c->width; x += 7) {
        const Vec3d ray = unproject(*c, {double(x), double(y)});
        if (!(std::hypot(ray.x, ray.y) < calibration.depth.metric_radius)) continue;
        const auto back = project(*c, ray);
        ASSERT_TRUE(back) << mode.name << " " << x << " " << y;
        ASSERT_NEAR(back->x, x, 1e-6);
        ASSERT_NEAR(back->y, y, 1e-6);
        ++valid;
      }
    EXPECT_GT(49 * valid, 0.7 * c->width * c->height) << mode.name;  // a circle has 0.785
  }
}

TEST(KinectCalibration, TheGenuineOne) {
  const auto file = test::shared_data() / "azure_kinect_mkv/calibration.json";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no recordings at " << file;
  const auto bytes = read_file(file);
  ASSERT_TRUE(bytes);
  const std::string json(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  expect_intrinsics(depth_of(json, "NFOV_UNBINNED"), 332.8, 348.8, 504.6, 504.7, 0.06);
  expect_intrinsics(color_of(json, "MJPG_720P"), 639.3, 365.9, 611.8, 611.9, 0.06);
  const KinectCalibration calibration = parsed(json);
  EXPECT_EQ(calibration.serial, "001514394512");
  EXPECT_DOUBLE_EQ(calibration.color->metric_radius, 1.7);
  EXPECT_NEAR(T_color_depth(calibration).translation.x, -0.0320834, 1e-7);
  EXPECT_NEAR(T_color_depth(calibration).rotation(1, 2), 0.0861603, 1e-6);
  // What the recording's accelerometer measures at rest points up, against the depth camera's y.
  const Vec3d measured{-2.888, -0.194, -9.437};
  const Vec3d up = transposed(calibration.T_accelerometer_reference->rotation) * measured;
  EXPECT_LT(up.y, -9.6);
}

TEST(KinectCalibration, ByteOrderMarkAndZerosAreAllowed) {
  const auto plain = depth_of(example(), "NFOV_UNBINNED");
  EXPECT_EQ(depth_of("\xEF\xBB\xBF" + example() + std::string(1, '\0'), "NFOV_UNBINNED"), plain);
  EXPECT_EQ(depth_of(example() + "\r\n" + std::string(3, '\0'), "NFOV_UNBINNED"), plain);
}

TEST(KinectCalibration, RadiusIsTheFilesOrTheParametersOrTheUsual) {
  EXPECT_DOUBLE_EQ(parsed(example()).depth.metric_radius, 1.7399997711181641);
  EXPECT_DOUBLE_EQ(parsed(example()).color->metric_radius, 1.7);
  const std::string fifteen =
      replaced(replaced(depth_json(), "\"ModelParameterCount\": 14", "\"ModelParameterCount\": 15"),
               "0.00015635808813385666", "0.00015635808813385666, 1.25");
  EXPECT_DOUBLE_EQ(parsed(file_of(fifteen)).depth.metric_radius, 1.7399997711181641);
  const std::string without = replaced(fifteen, "1.7399997711181641", "0");
  EXPECT_DOUBLE_EQ(parsed(file_of(without)).depth.metric_radius, 1.25);
  EXPECT_DOUBLE_EQ(parsed(file_of(replaced(without, "1.25", "0"))).depth.metric_radius, 1.7);
  EXPECT_DOUBLE_EQ(
      parsed(file_of(replaced(without, "\"MetricRadius\": 0,", ""))).depth.metric_radius, 1.25);
}

TEST(KinectCalibration, EarlyDevicesHaveHalfTheMixedTerms) {
  const std::string early = file_of(replaced(depth_json(), "BrownConrady", "Rational6KT"));
  const Camera usual = depth_of(example(), "NFOV_UNBINNED");
  const Camera c = depth_of(early, "NFOV_UNBINNED");
  const Vec3d point{0.5, 0.4, 1};
  const auto a = project(usual, point), b = project(c, point);
  ASSERT_TRUE(a && b);
  EXPECT_NEAR(a->x - b->x, usual.fx * usual.p[0] * 0.5 * 0.4, 1e-9);
  EXPECT_NEAR(a->y - b->y, usual.fy * usual.p[1] * 0.5 * 0.4, 1e-9);
  EXPECT_GT(a->x - b->x, 0.01);
}

TEST(KinectCalibration, WideColourSensorsAreTheMiddleOfOnesOfFourToThree) {
  // The same lens, its shares counted on 4096x2304.
  const std::string color = camera_json(
      "PV0", "0.5, 0.51, 0.48, 0.85, 0.3, -2.5, 1.5, 0.2, -2.3, 1.4, 0, 0, -0.0001, -0.0002", "0",
      R"("SensorWidth": 4096, "SensorHeight": 2304)", kColorPose);
  const Camera c = color_of(file_of(depth_json() + "," + color), "2160P");
  // 2160P shows all of the 16:9 sensor, scaled by 3840 / 4096.
  expect_intrinsics(c, 0.5 * 3840 - 0.5, 0.51 * 2160 - 0.5, 0.48 * 3840, 0.85 * 2160, 1e-9);
}

TEST(KinectCalibration, OrbbecGivesBothCamerasTheTransformToColour) {
  const std::string depth =
      camera_json("D0", "0.5, 0.5, 0.5, 0.5, 0.1, -0.05, 0.01, 0, 0, 0, 0, 0, 0.0001, 0.0002", "0",
                  R"("SensorWidth": 1024, "SensorHeight": 1024)", kColorPose);
  const KinectCalibration calibration = parsed(file_of(depth + "," + color_json()));
  EXPECT_DOUBLE_EQ(calibration.depth.metric_radius, 1.7);
  EXPECT_EQ(T_color_depth(calibration), calibration.color->T_camera_reference);
  const auto c = depth_camera(calibration, *find_depth_mode("NFOV_UNBINNED"));
  ASSERT_TRUE(c);
  EXPECT_TRUE(project(*c, {0.6, 0.5, 1}));
}

TEST(KinectCalibration, ColourMayBeMissing) {
  const KinectCalibration calibration = parsed(file_of(depth_json()));
  EXPECT_FALSE(calibration.color);
  EXPECT_EQ(T_color_depth(calibration), Pose{});
  EXPECT_THAT(color_camera(calibration, 1280, 720).error().message, HasSubstr("PV0"));
}

TEST(KinectCalibration, ColourOfOtherSizesHasNoFactoryCalibration) {
  const KinectCalibration calibration = parsed(example());
  EXPECT_EQ(*color_camera(calibration, 1920, 1080), color_of(example(), "1080P"));
  const auto small = color_camera(calibration, 960, 540);
  ASSERT_FALSE(small);
  EXPECT_EQ(small.error().cause, Error::Cause::unsupported);
  EXPECT_THAT(small.error().message, AllOf(HasSubstr("960x540"), HasSubstr("color_camera")));
}

TEST(KinectCalibration, BadFilesAreOneLineThatNamesTheField) {
  const auto with = [](const std::string& from, const std::string& to) {
    return failure(replaced(example(), from, to));
  };
  EXPECT_THAT(failure(""), HasSubstr("not valid JSON"));
  EXPECT_THAT(failure(example().substr(0, 900)), HasSubstr("cut off"));
  EXPECT_THAT(failure("{\"metadata\": {}}"), HasSubstr("CalibrationInformation"));
  EXPECT_THAT(failure("[1, 2]"), HasSubstr("CalibrationInformation"));
  EXPECT_THAT(failure(std::string(2u << 20, ' ')), HasSubstr("1 MiB"));
  EXPECT_THAT(failure(file_of("")), HasSubstr("Cameras have no depth camera"));
  EXPECT_THAT(failure(file_of("1, null, [2]")), HasSubstr("Cameras have no depth camera"));
  EXPECT_THAT(failure(file_of(depth_json() + "," + depth_json())),
              HasSubstr("Cameras[1].Location"));
  EXPECT_THAT(with("\"ModelParameterCount\": 14", "\"ModelParameterCount\": 8"),
              HasSubstr("Cameras[0].Intrinsics.ModelParameterCount"));
  EXPECT_THAT(with(", 7.02285033185035E-5", ""),
              HasSubstr("Cameras[0].Intrinsics.ModelParameters must be a list of 14 numbers"));
  EXPECT_THAT(with("0.49295613169670105", "-0.5"),
              HasSubstr("Cameras[0].Intrinsics.ModelParameters[2] is a focal length"));
  EXPECT_THAT(with("2.0663304328918457", "\"2\""),
              HasSubstr("Cameras[0].Intrinsics.ModelParameters[5] must be a number"));
  EXPECT_THAT(with("2.0663304328918457", "1e300"),
              HasSubstr("Cameras[0].Intrinsics.ModelParameters[5] must be between"));
  EXPECT_THAT(with("2.0663304328918457", "1e999"), HasSubstr("not valid JSON"));
  EXPECT_THAT(with("0, 0, 7.02", "0, 0.01, 7.02"), HasSubstr("ModelParameters[11] shifts"));
  EXPECT_THAT(with("ModelBrownConrady", "ModelTheta"),
              AllOf(HasSubstr("ModelType"), HasSubstr("Theta'"), HasSubstr("Rational6KT")));
  EXPECT_THAT(with("\"SensorWidth\": 4096", "\"SensorWidth\": 0"),
              HasSubstr("Cameras[1].SensorWidth"));
  EXPECT_THAT(with("1.7399997711181641", "\"far\""), HasSubstr("Cameras[0].MetricRadius"));
  EXPECT_THAT(with("0.99573004245758057", "-0.99573004245758057"),
              HasSubstr("Cameras[1].Rt.Rotation"));
  EXPECT_THAT(with("-0.032023865729570389", "-32.02"),
              AllOf(HasSubstr("Cameras[1].Rt.Translation"), HasSubstr("metres")));
  EXPECT_THAT(with("\"Cameras\": [{", "\"Cameras\": {\"a\": [{"), HasSubstr("not valid JSON"));
  for (const char* bad : {"{\"CalibrationInformation\": {\"Cameras\": 3}}", "null", "7"})
    EXPECT_THAT(failure(bad), Not(HasSubstr("\n")));
}

TEST(KinectCalibration, ALensThatDoesNotFitTheModeIsAnError) {
  const KinectCalibration calibration = parsed(
      file_of(replaced(depth_json(), "0.49862006306648254", "0.05")));  // left of NFOV's picture
  const auto c = depth_camera(calibration, *find_depth_mode("NFOV_UNBINNED"));
  ASSERT_FALSE(c);
  EXPECT_THAT(c.error().message, AllOf(HasSubstr("NFOV_UNBINNED"), HasSubstr("principal point")));
  EXPECT_TRUE(depth_camera(calibration, *find_depth_mode("WFOV_UNBINNED")));
}

}  // namespace
}  // namespace mr::sensor
