#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "mr/core/file.h"
#include "mr/kit/image_io.h"
#include "mr/synth/depth_png.h"
#include "mr/synth/hash.h"
#include "mr/synth/sensor_files.h"

namespace mr::synth {
namespace {

using std::chrono::microseconds;

constexpr double kCountsPerMetre = 5000;
// As in sequence fr1/xyz: the first pictures' times, of which depth's is the earlier.
constexpr microseconds kFirstDepth{1'305'031'102'160'407}, kFirstColor{1'305'031'102'165'304};
constexpr int kUneven_us = 1000;

/// "1305031102.160407"
std::string seconds_text(microseconds at) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%lld.%06lld",
                static_cast<long long>(at.count() / 1'000'000),
                static_cast<long long>(at.count() % 1'000'000));
  return text.data();
}

/// x y z w, of unit length (Shepperd 1978): by the largest of the four for precision.
std::array<double, 4> quaternion_of(const Mat3& R) {
  const double trace = R(0, 0) + R(1, 1) + R(2, 2);
  int largest = 3;
  for (int i = 0; i < 3; ++i)
    if (R(i, i) > (largest == 3 ? trace : R(largest, largest))) largest = i;
  std::array<double, 4> q{};
  if (largest == 3) {
    q = {R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1), 1 + trace};
  } else {
    const int i = largest, j = (i + 1) % 3, k = (i + 2) % 3;
    q[i] = 1 + R(i, i) - R(j, j) - R(k, k);
    q[j] = R(j, i) + R(i, j);
    q[k] = R(k, i) + R(i, k);
    q[3] = R(k, j) - R(j, k);
  }
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& v : q) v /= norm;
  return q;
}

class TumFolder final : public SensorFiles {
 public:
  TumFolder(std::filesystem::path folder, const Pose& T_world_depth, double fps)
      : folder_(std::move(folder)), pose_text_(text_of_pose(T_world_depth)), fps_(fps) {}

  Status write(const Frame& frame) override {
    const auto since = std::chrono::round<microseconds>(frame.captured_at().time_since_epoch());
    if (const Status ok = write_depth(frame.depth, kFirstDepth + since); !ok) return ok;
    const auto color = kit::encode_png(frame.color);
    if (!color) return color.error();
    last_color_ = *color, last_ = since;
    return write_color(since);
  }

  /// The lists, and after the last frame one more picture of colour.
  Status close() override {
    const auto period = microseconds(std::llround(1e6 / fps_));
    if (const Status ok = write_color(last_ + period); !ok) return ok;
    poses_ += seconds_text(kFirstDepth + last_ + period) + pose_text_;
    const std::string by = "# file: '" + folder_.filename().string() + "'\n";
    Status ok = write_file(folder_ / "rgb.txt",
                           "# color images\n" + by + "# timestamp filename\n" + color_);
    if (ok)
      ok = write_file(folder_ / "depth.txt",
                      "# depth maps\n" + by + "# timestamp filename\n" + depth_);
    if (ok)
      ok = write_file(
          folder_ / "groundtruth.txt",
          "# ground truth trajectory\n" + by + "# timestamp tx ty tz qx qy qz qw\n" + poses_);
    return ok;
  }

 private:
  static std::string text_of_pose(const Pose& T) {
    const Vec3d t = T.translation;
    const std::array<double, 4> q = quaternion_of(T.rotation);
    std::array<char, 200> text{};
    std::snprintf(text.data(), text.size(), " %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", t.x, t.y, t.z,
                  q[0], q[1], q[2], q[3]);
    return text.data();
  }

  Status write_depth(const ImageDepth& depth, microseconds at) {
    std::vector<std::uint16_t> counts(depth.data.size());
    for (std::size_t i = 0; i < counts.size(); ++i)
      counts[i] = static_cast<std::uint16_t>(
          std::min(std::lround(depth.data[i] * kCountsPerMetre), 65535l));
    const std::string stamp = seconds_text(at), file = "depth/" + stamp + ".png";
    depth_ += stamp + " " + file + "\n";
    poses_ += stamp + pose_text_;
    return write_depth_png(folder_ / file, depth.width, depth.height, counts);
  }

  Status write_color(microseconds since) {
    const auto uneven =
        static_cast<std::int64_t>(mix(since.count()) % (2 * kUneven_us)) - kUneven_us;
    const std::string stamp = seconds_text(kFirstColor + since + microseconds(uneven));
    const std::string file = "rgb/" + stamp + ".png";
    color_ += stamp + " " + file + "\n";
    return write_file(folder_ / file, last_color_);
  }

  const std::filesystem::path folder_;
  const std::string pose_text_;  ///< the end of its lines
  const double fps_;
  std::string color_, depth_, poses_;  ///< lines of the lists
  std::vector<std::byte> last_color_;
  microseconds last_{};
};

}  // namespace

Result<std::unique_ptr<SensorFiles>> open_tum_folder(const std::filesystem::path& folder,
                                                     const Pose& T_world_depth, double fps) {
  for (const char* kind : {"rgb", "depth"})
    if (const Status made = make_folder(folder / kind); !made) return made.error();
  return std::unique_ptr<SensorFiles>(std::make_unique<TumFolder>(folder, T_world_depth, fps));
}

}  // namespace mr::synth
