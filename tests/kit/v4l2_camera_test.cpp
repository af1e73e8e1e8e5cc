#include "mr/kit/v4l2_camera.h"

#include <gmock/gmock.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <deque>
#include <map>
#include <set>

#include "mr/kit/image_io.h"

namespace mr::kit {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// A driver of one camera, /dev/video2, behind the system calls.
struct FakeDriver {
  // What it is like.
  std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  std::uint32_t offered = V4L2_PIX_FMT_MJPEG, width = 64, height = 48, row_bytes = 0;
  std::set<std::uint32_t> missing, refused;  ///< controls
  int open_errno = 0;
  std::uint32_t buffer_bytes = 65536;
  bool is_lost = false;

  // What comes.
  struct Picture {
    std::vector<std::byte> bytes;
    std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    Duration age = 5ms;
    std::uint32_t claimed_bytes = 0;  ///< 0: those of `bytes`
  };
  std::deque<Picture> pictures;

  // What was done.
  int open_files = 0, mapped = 0;
  bool streams = false;
  std::map<std::uint32_t, int> controls;
  double fps = 0;
  std::deque<std::uint32_t> queued;
  std::array<std::vector<std::byte>, 4> memory;
  std::uint32_t sequence = 0;

  int ioctl(unsigned long request, void* argument);
  int dequeue(v4l2_buffer& buffer);
  int control(v4l2_control& asked);
};

FakeDriver* driver = nullptr;

int fails(int code) {
  errno = code;
  return -1;
}

int FakeDriver::control(v4l2_control& asked) {
  if (missing.contains(asked.id)) return fails(EINVAL);
  if (refused.contains(asked.id)) return fails(ERANGE);
  controls[asked.id] = asked.value;
  return 0;
}

int FakeDriver::dequeue(v4l2_buffer& buffer) {
  if (pictures.empty() || queued.empty()) return fails(EAGAIN);
  const Picture picture = std::move(pictures.front());
  pictures.pop_front();
  buffer.index = queued.front();
  queued.pop_front();
  std::ranges::copy(picture.bytes, memory.at(buffer.index).begin());
  buffer.bytesused = picture.claimed_bytes > 0 ? picture.claimed_bytes
                                               : static_cast<std::uint32_t>(picture.bytes.size());
  buffer.flags = picture.flags;
  buffer.sequence = sequence++;
  const auto at = std::chrono::duration_cast<std::chrono::microseconds>(
      std::chrono::steady_clock::now().time_since_epoch() - picture.age);
  buffer.timestamp.tv_sec = at / 1s;
  buffer.timestamp.tv_usec = at % 1s / 1us;
  return 0;
}

int FakeDriver::ioctl(unsigned long request, void* argument) {
  if (is_lost) return fails(ENODEV);
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto& out = *static_cast<v4l2_capability*>(argument);
      std::memcpy(out.card, "A camera", 9);
      out.capabilities = capabilities;
      return 0;
    }
    case VIDIOC_ENUM_FMT: {
      auto& out = *static_cast<v4l2_fmtdesc*>(argument);
      if (out.index > 0) return fails(EINVAL);
      out.pixelformat = offered;
      return 0;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
      auto& out = *static_cast<v4l2_frmsizeenum*>(argument);
      if (out.index > 1) return fails(EINVAL);
      out.type = V4L2_FRMSIZE_TYPE_DISCRETE;
      out.discrete.width = width / (out.index + 1), out.discrete.height = height / (out.index + 1);
      return 0;
    }
    case VIDIOC_S_FMT: {
      auto& pix = static_cast<v4l2_format*>(argument)->fmt.pix;
      pix.pixelformat = offered, pix.width = width, pix.height = height;
      pix.bytesperline = row_bytes;
      return 0;
    }
    case VIDIOC_S_PARM: {
      const auto& time = static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe;
      fps = static_cast<double>(time.denominator) / time.numerator;
      return 0;
    }
    case VIDIOC_S_CTRL:
      return control(*static_cast<v4l2_control*>(argument));
    case VIDIOC_QUERYCTRL: {
      auto& out = *static_cast<v4l2_queryctrl*>(argument);
      if (missing.contains(out.id)) return fails(EINVAL);
      out.minimum = 3, out.maximum = 2047;
      return 0;
    }
    case VIDIOC_REQBUFS:
      static_cast<v4l2_requestbuffers*>(argument)->count = 3;
      return 0;
    case VIDIOC_QUERYBUF: {
      auto& out = *static_cast<v4l2_buffer*>(argument);
      out.length = buffer_bytes;
      out.m.offset = out.index;
      return 0;
    }
    case VIDIOC_QBUF:
      queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
      return 0;
    case VIDIOC_DQBUF:
      return dequeue(*static_cast<v4l2_buffer*>(argument));
    case VIDIOC_STREAMON:
      streams = true;
      return 0;
    case VIDIOC_STREAMOFF:
      streams = false;
      return 0;
    default:
      return fails(ENOTTY);
  }
}

constexpr V4l2Calls kFakeCalls{
    .open =
        [](const char* path) {
          if (driver->open_errno != 0) return fails(driver->open_errno);
          if (std::string_view(path) != "/dev/video2") return fails(ENOENT);
          return ++driver->open_files;
        },
    .close =
        [](int) {
          --driver->open_files;
          return 0;
        },
    .ioctl = [](int, unsigned long request,
                void* argument) { return driver->ioctl(request, argument); },
    .mmap = [](std::size_t length, int, off_t offset) -> void* {
      auto& memory = driver->memory.at(static_cast<std::size_t>(offset));
      memory.resize(length);
      ++driver->mapped;
      return memory.data();
    },
    .munmap =
        [](void*, std::size_t) {
          --driver->mapped;
          return 0;
        },
    .wait_readable =
        [](int, int) {
          if (driver->is_lost) return fails(ENODEV);
          return driver->pictures.empty() ? 0 : 1;
        },
};

class V4l2CameraTest : public testing::Test {
 protected:
  V4l2CameraTest() { driver = &driver_; }
  ~V4l2CameraTest() override {
    EXPECT_EQ(driver_.open_files, 0);
    EXPECT_EQ(driver_.mapped, 0);
    EXPECT_FALSE(driver_.streams);
    driver = nullptr;
  }
  static V4l2Config config() { return {.device = "/dev/video2", .width = 64, .height = 48}; }
  static Result<V4l2Camera> open(const V4l2Config& config) {
    return V4l2Camera::open(config, kFakeCalls);
  }
  static std::string refusal(const V4l2Config& config) {
    const auto camera = open(config);
    return camera ? "" : camera.error().message;
  }
  static FakeDriver::Picture jpeg(std::uint8_t level = 100) {
    FakeDriver::Picture out;
    out.bytes = *encode_jpeg(ImageRgb(64, 48, level), 90);
    return out;
  }

  FakeDriver driver_;
};

TEST_F(V4l2CameraTest, GivesPicturesWithTheirTimes) {
  auto camera = open(config());
  ASSERT_TRUE(camera.ok()) << camera.error().message;
  EXPECT_EQ(driver_.fps, 30);
  for (int i = 0; i < 7; ++i) driver_.pictures.push_back(jpeg(static_cast<std::uint8_t>(10 * i)));
  driver_.pictures[0].age = 250ms;
  for (std::uint32_t i = 0; i < 7; ++i) {  // more than there are buffers
    const auto picture = camera->next(1s);
    ASSERT_TRUE(picture.ok() && *picture);
    EXPECT_EQ((*picture)->sequence, i);
    EXPECT_EQ((*picture)->color.width, 64);
    EXPECT_NEAR(*(*picture)->color.at(9, 9), 10 * i, 2);
    const Duration age = std::chrono::system_clock::now() - (*picture)->at;
    EXPECT_GT(age, i == 0 ? 249ms : 4ms);
    EXPECT_LT(age, 5s);
  }
  const auto none = camera->next(0s);
  EXPECT_TRUE(none.ok() && !*none) << "it waits, and nothing comes";
  EXPECT_EQ(driver_.queued.size(), 3u) << "the driver has all its buffers back";
}

TEST_F(V4l2CameraTest, ConvertsYuyvWithGapsBetweenRows) {
  driver_.offered = V4L2_PIX_FMT_YUYV;
  driver_.row_bytes = 160;
  V4l2Config yuyv = config();
  yuyv.format = V4l2Config::Format::yuyv;
  auto camera = open(yuyv);
  ASSERT_TRUE(camera.ok()) << camera.error().message;
  FakeDriver::Picture grey;
  grey.bytes.assign(160 * 48 + 512, std::byte{128});  // a page's rest behind it
  for (std::size_t i = 0; i < grey.bytes.size(); i += 2) grey.bytes[i] = std::byte{235};
  driver_.pictures = {grey};
  const auto picture = camera->next(1s);
  ASSERT_TRUE(picture.ok() && *picture) << picture.error().message;
  EXPECT_EQ(*(*picture)->color.at(63, 47), 255) << "Y 235 is white";
  driver_.pictures = {grey};
  driver_.pictures[0].bytes.resize(3000);
  EXPECT_THAT(camera->next(1s).error().message, HasSubstr("picture 1: "));
}

TEST_F(V4l2CameraTest, ABrokenPictureIsLostAndTheStreamGoesOn) {
  auto camera = open(config());
  ASSERT_TRUE(camera.ok());
  FakeDriver::Picture broken = jpeg(), cut = jpeg(), other = jpeg(), lying = jpeg();
  broken.flags |= V4L2_BUF_FLAG_ERROR;
  cut.bytes.resize(100);
  other.bytes = *encode_jpeg(ImageRgb(32, 32, 1), 90);
  lying.claimed_bytes = 1u << 30;
  driver_.pictures = {broken, cut, other, lying, jpeg()};
  for (const char* why : {"broken on its way", "picture 1", "another size", "broken on its way"}) {
    const auto lost = camera->next(1s);
    ASSERT_FALSE(lost.ok());
    EXPECT_EQ(lost.error().cause, Error::Cause::corrupt);
    EXPECT_THAT(lost.error().message,
                AllOf(HasSubstr("/dev/video2: picture"), HasSubstr(why), Not(HasSubstr("\n"))));
  }
  EXPECT_TRUE(camera->next(1s)->has_value());
}

TEST_F(V4l2CameraTest, AnUnpluggedCameraIsLost) {
  auto camera = open(config());
  driver_.is_lost = true;
  const auto lost = camera->next(1s);
  ASSERT_FALSE(lost.ok());
  EXPECT_EQ(lost.error().cause, Error::Cause::io);
  EXPECT_THAT(lost.error().message, HasSubstr("/dev/video2: the camera is lost: No such device"));
  driver_.streams = false;
}

TEST_F(V4l2CameraTest, ExposureWhiteBalanceAndGainAreLocked) {
  V4l2Config locked = config();
  locked.exposure_us = 8000, locked.white_balance_k = 4500, locked.gain = 12;
  ASSERT_TRUE(open(locked).ok());
  EXPECT_EQ(driver_.controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE], 80) << "in 100 us";
  EXPECT_EQ(driver_.controls[V4L2_CID_AUTO_WHITE_BALANCE], 0);
  EXPECT_EQ(driver_.controls[V4L2_CID_WHITE_BALANCE_TEMPERATURE], 4500);
  EXPECT_EQ(driver_.controls[V4L2_CID_AUTOGAIN], 0);
  EXPECT_EQ(driver_.controls[V4L2_CID_GAIN], 12);
}

TEST_F(V4l2CameraTest, WhatIsNotLockedIsAutomaticAgain) {
  ASSERT_TRUE(open(config()).ok());
  EXPECT_EQ(driver_.controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_APERTURE_PRIORITY);
  EXPECT_EQ(driver_.controls[V4L2_CID_AUTO_WHITE_BALANCE], 1);
  EXPECT_FALSE(driver_.controls.contains(V4L2_CID_GAIN));
}

TEST_F(V4l2CameraTest, CamerasWithFewControlsAreUsed) {
  driver_.missing = {V4L2_CID_AUTOGAIN, V4L2_CID_EXPOSURE_AUTO, V4L2_CID_AUTO_WHITE_BALANCE};
  EXPECT_EQ(refusal(config()), "");
}

TEST_F(V4l2CameraTest, RefusalsSayWhatToDo) {
  V4l2Config gain = config();
  gain.gain = 5000;
  driver_.refused = {V4L2_CID_GAIN};
  EXPECT_EQ(refusal(gain), "/dev/video2: gain 5000 is refused: it takes 3 to 2047");
  driver_.missing = {V4L2_CID_GAIN};
  EXPECT_THAT(refusal(gain), HasSubstr("the camera cannot set it"));
  driver_.width = 32;
  EXPECT_THAT(refusal(config()),
              HasSubstr("/dev/video2: MJPG 64x48 is not offered; nearest is MJPG 32x48"));
  driver_.capabilities = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
  EXPECT_THAT(refusal(config()), HasSubstr("A camera is no camera that streams"));
  driver_.open_errno = EBUSY;
  EXPECT_THAT(refusal(config()), HasSubstr("/dev/video2: cannot be opened: Device or resource"));
  driver_.open_errno = ENOENT;
  EXPECT_EQ(open(config()).error().cause, Error::Cause::not_found);
  V4l2Config odd = config();
  odd.fps = 0;
  EXPECT_THAT(refusal(odd), HasSubstr("fps"));
}

TEST_F(V4l2CameraTest, ImpossibleBuffersAreRefused) {
  driver_.buffer_bytes = 0;
  EXPECT_THAT(refusal(config()), HasSubstr("impossible size"));
  driver_.buffer_bytes = 0xFFFFFFFF;
  EXPECT_THAT(refusal(config()), HasSubstr("impossible size"));
}

TEST_F(V4l2CameraTest, CamerasAreListed) {
  const auto found = find_v4l2_cameras(kFakeCalls);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].path, "/dev/video2");
  EXPECT_EQ(found[0].name, "A camera");
  EXPECT_THAT(found[0].formats, testing::ElementsAre("MJPG 64x48 32x24"));
  driver_.capabilities = V4L2_CAP_META_CAPTURE;
  EXPECT_TRUE(find_v4l2_cameras(kFakeCalls).empty());
}

TEST(V4l2CameraOfThisComputer, ADeviceThatIsNotThereIsNotFound) {
  const auto camera = V4l2Camera::open({.device = "/dev/video-that-is-not-there"});
  ASSERT_FALSE(camera.ok());
  EXPECT_EQ(camera.error().cause, Error::Cause::not_found);
  const auto file = V4l2Camera::open({.device = "/dev/null"});
  EXPECT_THAT(file.error().message, HasSubstr("/dev/null: is no video device"));
}

}  // namespace
}  // namespace mr::kit
