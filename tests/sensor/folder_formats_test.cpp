#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "core/temp_dir.h"
#include "mr/kit/image_io.h"
#include "mr/sensor/folders/camera_files.h"
#include "mr/sensor/folders/numbered_files.h"
#include "mr/sensor/folders/picture_folder.h"
#include "mr/sensor/recording_formats.h"
#include "support/pictures.h"
#include "support/shared_data.h"

namespace mr::sensor {
namespace {

using std::filesystem::path;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

std::string text_of(const RecordingInfo& info, const std::string& name) {
  for (const RecordingInfo::Field& field : info.fields) {
    if (field.name != name) continue;
    if (const auto* text = std::get_if<std::string>(&field.value)) return *text;
    if (const auto* whole = std::get_if<std::int64_t>(&field.value)) return std::to_string(*whole);
    if (const auto* list = std::get_if<std::vector<double>>(&field.value))
      return testing::PrintToString(*list);
    return testing::PrintToString(std::get<double>(field.value));
  }
  return "none";
}

std::string pose_text(double x) {
  return "1 0 0 " + std::to_string(x) + "\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
}

std::string pose_line(double x) {
  std::string text = pose_text(x);
  std::replace(text.begin(), text.end() - 1, '\n', ' ');
  return text;
}

/// Folders as data sets have them, with pictures of 64x48 pixels.
class FolderFormats : public testing::Test {
 protected:
  void depth(const std::string& name, std::uint16_t count, int width = 64, int height = 48) {
    Image<std::uint16_t, 1> image(width, height, count);
    for (int i = 0; i < width; ++i) image.data[static_cast<std::size_t>(i)] = 65535;
    dir_.write(name, test::depth_png(image));
  }
  void color(const std::string& name, int width = 64, int height = 48) {
    const ImageRgb image = test::gradient(width, height);
    const auto bytes = name.ends_with("png") ? kit::encode_png(image) : kit::encode_jpeg(image, 90);
    ASSERT_TRUE(bytes);
    dir_.write(name, {reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  }

  std::string recognized(const std::string& name) {
    const RecordingFormat* format = recognize(dir_ / name);
    return format ? std::string(format->name) : "";
  }
  RecordingInfo described(const std::string& name) {
    const auto info = recognize(dir_ / name)->describe(dir_ / name);
    EXPECT_TRUE(info) << info.error().message;
    return info ? *info : RecordingInfo{};
  }
  ImportedScene imported(const std::string& name) {
    const auto scene = recognize(dir_ / name)->import(dir_ / name);
    EXPECT_TRUE(scene) << scene.error().message;
    return scene ? *scene : ImportedScene{};
  }
  std::string refused(const std::string& name) {
    const auto scene = recognize(dir_ / name)->import(dir_ / name);
    return scene ? "" : scene.error().message;
  }

  test::TempDir dir_;
};

TEST_F(FolderFormats, OthersAreOfNone) {
  dir_.write("other/readme.txt", "x");
  EXPECT_EQ(recognized("other"), "");
  EXPECT_EQ(recognized("none"), "");
  EXPECT_EQ(recognized("other/readme.txt"), "");
}

TEST_F(FolderFormats, AJsonOfADeviceThatIsDamagedIsNamed) {
  const path kinect = dir_.write("a.json", "{\"CalibrationInformation\": 1}");
  const path lidar = dir_.write("b.json", "{\"beam_altitude_angles\": 1}");
  for (const path& file : {kinect, lidar}) {
    ASSERT_TRUE(recognize(file));
    const auto info = recognize(file)->describe(file);
    ASSERT_FALSE(info);
    EXPECT_THAT(info.error().message, testing::StartsWith(file.string() + ": "));
  }
  EXPECT_EQ(recognize(dir_.write("c.json", "{}")), nullptr);
}

TEST_F(FolderFormats, SevenScenes) {
  for (int i = 0; i < 3; ++i) {
    const std::string frame = "s/seq/frame-00000" + std::to_string(i);
    depth(frame + ".depth.png", static_cast<std::uint16_t>(1500 + i));
    if (i != 1) color(frame + ".color.jpg");
    dir_.write(frame + ".pose.txt", i == 2 ? "-inf -inf -inf -inf\n" + pose_text(0) : pose_text(i));
  }
  dir_.write("s/camera-intrinsics.txt", "58 0 32\n0 59 24\n0 0 1\n");
  EXPECT_EQ(recognized("s/seq"), "7-Scenes or 3DMatch folder");
  const RecordingInfo info = described("s/seq");
  EXPECT_EQ(text_of(info, "depth_pictures"), "3");
  EXPECT_EQ(text_of(info, "depth_size"), "64x48");
  EXPECT_EQ(text_of(info, "first_depth_median"), "1.5") << "65535 is no depth";
  EXPECT_EQ(text_of(info, "first_depth_valid"), "97.9");
  EXPECT_EQ(text_of(info, "poses"), "2");
  EXPECT_EQ(text_of(info, "depth_fx_fy_cx_cy"), "{ 58, 59, 32, 24 }");
  EXPECT_THAT(info.notes, AllOf(Contains(HasSubstr("1 of 3 depth pictures have no colour")),
                                Contains(HasSubstr("1 of 3 poses cannot be used")),
                                Contains(HasSubstr("no times"))));

  const ImportedScene scene = imported("s/seq");
  ASSERT_EQ(scene.sensors.size(), 1u);
  const ImportedSensor& sensor = scene.sensors[0];
  EXPECT_EQ(sensor.id, "seq");
  EXPECT_THAT(sensor.source,
              AllOf(HasSubstr("seq/frame-%06d.depth.png\", first: 0, last: 2}"),
                    HasSubstr("seq/frame-%06d.color.jpg\", first: 0, last: 2}"),
                    HasSubstr("depth_unit_m: 0.001"), HasSubstr("invalid: [0, 65535]")));
  EXPECT_THAT(sensor.T_world_depth, HasSubstr("frame-%06d.pose.txt\", first: 0, last: 2}"));
  EXPECT_EQ(*sensor.depth_camera, *sensor.color_camera);
  ASSERT_TRUE(scene.up);
  EXPECT_EQ(*scene.up, (Vec3d{0, -1, 0}));
}

TEST_F(FolderFormats, NumbersThatDoNotFollowBecomeAList) {
  for (const char* number : {"000000", "000010", "000020"}) {
    depth(std::string("s/frame-") + number + ".depth.png", 1000);
    dir_.write(std::string("s/frame-") + number + ".pose.txt", pose_text(0));
  }
  dir_.write("s/camera-intrinsics.txt", "58 0 32 0\n0 58 24 0\n0 0 1 0\n0 0 0 1\n");
  const ImportedSensor sensor = imported("s").sensors.at(0);
  EXPECT_THAT(sensor.source, AllOf(HasSubstr("depth: [\""), HasSubstr("000010.depth.png\", "),
                                   Not(HasSubstr("color")), Not(HasSubstr("%"))));
  EXPECT_THAT(sensor.T_world_depth, HasSubstr("{files: [\""));
  EXPECT_FALSE(sensor.color_camera);
}

TEST_F(FolderFormats, TumBySequence) {
  for (int i = 0; i < 3; ++i) {
    depth("rgbd_dataset_freiburg1_desk/depth/" + std::to_string(i) + ".png", 7500, 640, 480);
    color("rgbd_dataset_freiburg1_desk/rgb/" + std::to_string(i) + ".png", 640, 480);
  }
  const auto list = [](const std::string& folder) {
    return "1000.0 " + folder + "/0.png\n1000.033 " + folder + "/1.png\n1000.067 " + folder +
           "/2.png\n";
  };
  const std::string name = "rgbd_dataset_freiburg1_desk";
  dir_.write(name + "/rgb.txt", list("rgb"));
  dir_.write(name + "/depth.txt", list("depth") + "1001.5 depth/x.png\n");
  dir_.write(name + "/groundtruth.txt", "999 0 0 0 0 0 0 1\n1002 1 0 0 0 0 0 1\n");
  EXPECT_EQ(recognized(name), "TUM RGB-D folder");
  const RecordingInfo info = described(name);
  EXPECT_EQ(text_of(info, "depth_unit"), "0.0002");
  EXPECT_EQ(text_of(info, "first_depth_median"), "1.5");
  EXPECT_EQ(text_of(info, "span"), "0.067");
  EXPECT_EQ(text_of(info, "fps"), "30");
  EXPECT_EQ(text_of(info, "poses"), "2");
  EXPECT_THAT(info.notes, ElementsAre(HasSubstr("1 of 4 depth pictures are left out")));
  const ImportedScene scene = imported(name);
  EXPECT_EQ(scene.fps, 30);
  const ImportedSensor& sensor = scene.sensors.at(0);
  EXPECT_EQ(sensor.depth_camera->fx, 517.3);
  EXPECT_THAT(sensor.source, AllOf(HasSubstr("{type: tum, folder: \""), HasSubstr("0.0002")));
  EXPECT_THAT(sensor.T_world_depth, HasSubstr("{trajectory: \""));
  EXPECT_THAT(scene.notes, Contains(HasSubstr("values of freiburg1")));

  std::filesystem::rename(dir_ / name, dir_ / "mine");
  EXPECT_EQ(imported("mine").sensors.at(0).depth_camera->fx, 525);
  EXPECT_THAT(imported("mine").sensors.at(0).comments, Contains(HasSubstr("put in your own")));
}

TEST_F(FolderFormats, ScanNet) {
  for (int i = 0; i < 2; ++i) {
    depth("scene0000_00/depth/" + std::to_string(i) + ".png", 2000);
    color("scene0000_00/color/" + std::to_string(i) + ".jpg", 128, 96);
    dir_.write("scene0000_00/pose/" + std::to_string(i) + ".txt", pose_text(i));
  }
  dir_.write("scene0000_00/intrinsic/intrinsic_depth.txt",
             "57 0 31 0\n0 57 23 0\n0 0 1 0\n0 0 0 1\n");
  dir_.write("scene0000_00/intrinsic/intrinsic_color.txt",
             "115 0 63 0\n0 116 47 0\n0 0 1 0\n0 0 0 1\n");
  EXPECT_EQ(recognized("scene0000_00"), "ScanNet export");
  EXPECT_EQ(text_of(described("scene0000_00"), "color_size"), "128x96");
  const ImportedSensor sensor = imported("scene0000_00").sensors.at(0);
  EXPECT_EQ(sensor.depth_camera->fx, 57);
  EXPECT_EQ(sensor.color_camera->fy, 116);
  EXPECT_EQ(sensor.color_camera->width, 128);
  EXPECT_THAT(sensor.T_world_depth, HasSubstr("pose/%d.txt"));
}

TEST_F(FolderFormats, ReplicaTellsItsScale) {
  for (int i = 0; i < 2; ++i) {
    depth("replica/room0/results/depth00000" + std::to_string(i) + ".png", 6553);
    color("replica/room0/results/frame00000" + std::to_string(i) + ".jpg");
  }
  dir_.write("replica/room0/traj.txt", pose_line(0) + pose_line(1));
  EXPECT_EQ(recognized("replica/room0"), "Replica folder");
  EXPECT_THAT(described("replica/room0").notes, Contains(HasSubstr("cam_params.json")));
  EXPECT_THAT(refused("replica/room0"), HasSubstr("no intrinsics are known"));
  dir_.write("replica/cam_params.json",
             R"({"camera": {"w": 64, "h": 48, "fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5,
                            "scale": 6553.0}})");
  const RecordingInfo info = described("replica/room0");
  EXPECT_EQ(text_of(info, "first_depth_median"), "1");
  EXPECT_THAT(text_of(info, "depth_unit_from"), HasSubstr("camera.scale of "));
  EXPECT_EQ(text_of(info, "poses"), "2");
  EXPECT_THAT(imported("replica/room0").sensors.at(0).T_world_depth, HasSubstr("traj.txt"));
}

TEST_F(FolderFormats, RedwoodNeedsAPoseForEachPicture) {
  for (int i = 1; i < 3; ++i) {
    depth("red/depth/00000" + std::to_string(i) + ".png", 900);
    color("red/image/00000" + std::to_string(i) + ".jpg");
  }
  dir_.write("red/camera.json",
             "{\n\t\"width\": 64,\n\t\"height\": 48,\n\t\"intrinsic_matrix\": [60, 0, 0, 0, 61, 0, "
             "31, 23, 1]\n}\n");
  dir_.write("red/trajectory.log", "0 0 1\n" + pose_text(0) + "1 1 2\n" + pose_text(1));
  EXPECT_EQ(recognized("red"), "Redwood or Open3D folder");
  const ImportedSensor sensor = imported("red").sensors.at(0);
  EXPECT_EQ(sensor.depth_camera->fy, 61);
  EXPECT_EQ(sensor.depth_camera->cx, 31);
  EXPECT_THAT(sensor.source, HasSubstr("red/depth/%06d.png\", first: 1, last: 2}"));
  EXPECT_THAT(sensor.T_world_depth, HasSubstr("trajectory.log"));

  dir_.write("red/trajectory.log", "0 0 1\n" + pose_text(0));
  EXPECT_EQ(imported("red").sensors.at(0).T_world_depth, "");
  EXPECT_THAT(described("red").notes,
              AllOf(Contains(HasSubstr("holds 1 poses for 2 depth pictures")),
                    Contains(HasSubstr("no poses are known"))));
}

TEST_F(FolderFormats, StillViewsBecomeASensorEach) {
  for (int i = 0; i < 3; ++i) depth("v/depth_" + std::to_string(i) + ".png", 1200);
  for (int i = 0; i < 2; ++i) dir_.write("v/pose_" + std::to_string(i) + ".txt", pose_text(i));
  EXPECT_EQ(recognized("v"), "folder of still depth views");
  EXPECT_THAT(described("v").notes, Contains(HasSubstr("1 of 3 views have no pose")));
  EXPECT_THAT(refused("v"), HasSubstr("no intrinsics are known for depth of 64x48 pixels"));
  dir_.write("v/camera-intrinsics.txt", "58 0 32\n0 59 24\n0 0 1\n");
  const ImportedScene scene = imported("v");
  ASSERT_EQ(scene.sensors.size(), 2u);
  EXPECT_EQ(scene.sensors[1].id, "view-1");
  EXPECT_THAT(scene.sensors[1].source, HasSubstr("depth_1.png"));
  EXPECT_THAT(scene.sensors[1].T_world_depth, AllOf(HasSubstr("{file: "), HasSubstr("pose_1.txt")));
}

TEST_F(FolderFormats, Cwipc) {
  const auto config = [&](const std::string& extra) {
    return R"({"version": 3, "type": "kinect_playback", "unknown": [1],
      "camera": [
        {"serial": "A1", "filename": "a.mkv", "trafo": [[1,0,0,0.5],[0,1,0,0],[0,0,1,2],[0,0,0,1]]},
        {"serial": "B2", "disabled": true, "filename": "b.mkv"},
        {"serial": "C3"},
        {"serial": "D4", "type": "realsense_playback", "playback_inpoint_micros": 7},
        {"serial": "E5", "type": "orbbec_playback", "filename": "e.bag"}],)" +
           extra + "}";
  };
  dir_.write("cw/a.mkv", "x");
  dir_.write("cw/cameraconfig.json",
             config(R"("system": {"fps": 15, "sync_master_serial": "A1"})"));
  EXPECT_EQ(recognized("cw"), "cwipc recording");
  const RecordingInfo info = described("cw");
  EXPECT_EQ(text_of(info, "sync_master"), "A1");
  EXPECT_EQ(text_of(info, "cameras"), "5");
  EXPECT_THAT(info.notes, AllOf(Contains(HasSubstr("'B2' is disabled")),
                                Contains(AllOf(HasSubstr("'C3'"), HasSubstr("cw/C3.mkv"))),
                                Contains(AllOf(HasSubstr("'D4'"), HasSubstr("cw/D4.bag"))),
                                Contains(AllOf(HasSubstr("'E5'"), HasSubstr("not supported")))));
  dir_.write("cw/cameraconfig.json", config(R"("sync": {"sync_master_serial": "C3"})"));
  EXPECT_EQ(text_of(described("cw"), "sync_master"), "C3");

  const ImportedScene scene = imported("cw");
  ASSERT_EQ(scene.sensors.size(), 3u);
  EXPECT_EQ(scene.sensors[0].id, "A1");
  EXPECT_THAT(scene.sensors[2].source,
              AllOf(HasSubstr("{type: realsense-bag, file: \""), HasSubstr("cw/D4.bag")));
  EXPECT_THAT(scene.sensors[0].source,
              AllOf(HasSubstr("{type: azure-kinect-mkv, file: \""), HasSubstr("cw/a.mkv")));
  EXPECT_EQ(scene.sensors[0].T_world_depth, "[1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 2, 0, 0, 0, 1]");
  EXPECT_FALSE(scene.sensors[0].depth_camera) << "the recording tells its own";
  EXPECT_EQ(scene.up, (Vec3d{0, 1, 0}));

  dir_.write("cw/cameraconfig.json", R"({"camera": [{"serial": "A", "trafo": [1, 2]}]})");
  EXPECT_THAT(refused("cw"), AllOf(HasSubstr("cameraconfig.json"), HasSubstr("trafo of camera")));
  dir_.write("cw/cameraconfig.json", "{");
  EXPECT_THAT(refused("cw"), HasSubstr("is not a JSON object"));
}

TEST_F(FolderFormats, SensIsDescribedByItsHeader) {
  std::string bytes;
  const auto add = [&](auto value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  add(std::uint32_t{4});
  add(std::uint64_t{15});
  bytes += "StructureSensor";
  for (int i = 0; i < 64; ++i) add(static_cast<float>(i));
  add(std::int32_t{2}), add(std::int32_t{1});
  for (const std::uint32_t side : {1296u, 968u, 640u, 480u}) add(side);
  add(1000.0f), add(std::uint64_t{5578});
  dir_.write("a.sens", bytes + "more");
  EXPECT_EQ(recognized("a.sens"), "ScanNet .sens file");
  const RecordingInfo info = described("a.sens");
  EXPECT_EQ(text_of(info, "sensor"), "StructureSensor");
  EXPECT_EQ(text_of(info, "frames"), "5578");
  EXPECT_EQ(text_of(info, "depth_size"), "640x480");
  EXPECT_EQ(text_of(info, "color_coding"), "jpeg");
  EXPECT_EQ(text_of(info, "depth_fx_fy_cx_cy"), "{ 32, 37, 34, 38 }");
  EXPECT_EQ(recognize(dir_ / "a.sens")->import, nullptr);
  dir_.write("a.sens", bytes.substr(0, 100));
  const auto cut = recognize(dir_ / "a.sens")->describe(dir_ / "a.sens");
  ASSERT_FALSE(cut);
  EXPECT_THAT(cut.error().message, HasSubstr("truncated"));
}

TEST_F(FolderFormats, PicturesAllAroundAreTwiceAsWideAsHigh) {
  color("pano.jpg", 1024, 512), color("photo.jpg", 1024, 768);
  EXPECT_EQ(recognized("pano.jpg"), "equirectangular picture");
  EXPECT_EQ(recognized("photo.jpg"), "");
  EXPECT_EQ(text_of(described("pano.jpg"), "color_size"), "1024x512");
}

TEST(CameraFiles, ErrorsNameFileAndField) {
  const auto matrix = [](const char* text) {
    const auto camera = parse_camera_matrix(text, 64, 48, "K.txt");
    return camera ? "" : camera.error().message;
  };
  EXPECT_EQ(matrix("58 0 32 0 58 24 0 0 1"), "");
  EXPECT_THAT(matrix("58 0 32"), HasSubstr("K.txt: holds 3 numbers"));
  EXPECT_THAT(matrix("58 0 32\n0 f 24\n0 0 1"), HasSubstr("K.txt: line 2 holds 'f'"));
  EXPECT_THAT(matrix("0 0 32 0 58 24 0 0 1"), HasSubstr("focal lengths"));
  EXPECT_THAT(matrix("58 0 90 0 58 24 0 0 1"), HasSubstr("principal point"));
  const auto open3d = [](const char* text) {
    const auto camera = parse_open3d_camera(text, "i.json");
    return camera ? "" : camera.error().message;
  };
  EXPECT_THAT(open3d("[1]"), HasSubstr("i.json: is not a JSON object"));
  EXPECT_THAT(open3d("{}"), HasSubstr("width and height"));
  EXPECT_THAT(open3d(R"({"width": 64, "height": 48, "intrinsic_matrix": [1]})"),
              HasSubstr("intrinsic_matrix, nine numbers"));
  EXPECT_THAT(open3d(R"({"width": 64, "height": 48,
                         "intrinsic_matrix": [60, 0, 31, 0, 60, 23, 0, 0, 1]})"),
              HasSubstr("column by column"));
  EXPECT_THAT(open3d((R"({"a": )" + std::string(40, '[') + std::string(40, ']') + "}").c_str()),
              HasSubstr("nested too deep"));
}

TEST(NumberedFiles, PatternsNameExactlyTheFiles) {
  EXPECT_EQ(files_text({"a/8.png", "a/9.png", "a/10.png"}),
            "{pattern: \"a/%d.png\", first: 8, last: 10}");
  EXPECT_EQ(files_text({"a/08.png", "a/09.png", "a/10.png"}),
            "{pattern: \"a/%02d.png\", first: 8, last: 10}");
  EXPECT_EQ(files_text({"a/8.png", "a/10.png"}), "[\"a/8.png\", \"a/10.png\"]");
  EXPECT_EQ(files_text({"a%/1.png", "a%/2.png"}), "[\"a%/1.png\", \"a%/2.png\"]");
  EXPECT_EQ(files_text({"\"/x.png"}), "[\"\\\"/x.png\"]");
}

TEST(RealFolders, AreDescribedRightly) {
  const path kitchen = test::shared_data() / "sevenscenes_redkitchen";
  if (!std::filesystem::exists(kitchen))
    GTEST_SKIP() << "no recordings at " << test::shared_data() << " (set MR_DATA)";
  for (const auto& [folder, count] :
       {std::pair(kitchen, "100"), std::pair(kitchen / "clip_000300_000389", "90")}) {
    const RecordingFormat* format = recognize(folder);
    ASSERT_TRUE(format) << folder;
    const auto info = format->describe(folder);
    ASSERT_TRUE(info) << info.error().message;
    EXPECT_EQ(info->format, "7-Scenes or 3DMatch folder");
    for (const char* field : {"depth_pictures", "color_pictures", "poses"})
      EXPECT_EQ(text_of(*info, field), count) << field;
    EXPECT_EQ(text_of(*info, "depth_size"), "640x480");
    EXPECT_EQ(text_of(*info, "depth_fx_fy_cx_cy"), "{ 585, 585, 320, 240 }");
    const double median_m = std::stod(text_of(*info, "first_depth_median"));
    EXPECT_TRUE(0.5 < median_m && median_m < 4) << median_m;
  }
  const path room = test::shared_data() / "room_bench";
  const RecordingFormat* format = recognize(room);
  ASSERT_TRUE(format);
  const auto scene = format->import(room);
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(scene->sensors.size(), 4u);
  EXPECT_EQ(scene->sensors[0].depth_camera->fx, 504);
  const path panorama = test::shared_data() / "equirect/examplepano.jpg";
  ASSERT_TRUE(recognize(panorama));
  EXPECT_EQ(recognize(panorama)->name, "equirectangular picture");
}

TEST(RealFiles, OfADeviceAloneAreDescribed) {
  const path data = test::shared_data();
  if (!std::filesystem::exists(data / "ouster") ||
      !std::filesystem::exists(data / "azure_kinect_mkv"))
    GTEST_SKIP() << "no recordings at " << data << " (set MR_DATA)";
  const auto described = [](const path& file) {
    const RecordingFormat* format = recognize(file);
    if (!format) return Result<RecordingInfo>(Error{Error::Cause::unsupported, file.string()});
    EXPECT_EQ(format->import, nullptr);
    return format->describe(file);
  };
  const auto kinect = described(data / "azure_kinect_mkv/calibration.json");
  ASSERT_TRUE(kinect) << kinect.error().message;
  EXPECT_EQ(text_of(*kinect, "depth_fx_fy_cx_cy").substr(0, 7), "{ 504.6");
  const auto lidar = described(data / "ouster/OS-1-128_v2.3.0_1024x10.json");
  ASSERT_TRUE(lidar) << lidar.error().message;
  EXPECT_EQ(text_of(*lidar, "profile"), "RNG15_RFL8_NIR8");
  EXPECT_EQ(recognize(data / "ouster/OS-2-32-U0_v2.0.0_1024x10_digest.json"), nullptr);
}

}  // namespace
}  // namespace mr::sensor
