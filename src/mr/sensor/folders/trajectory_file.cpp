#include "mr/sensor/folders/trajectory_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "mr/core/user_text.h"
#include "mr/sensor/folders/text_lines.h"

namespace mr::sensor {
namespace {

using Layout = TrajectoryFile::Layout;

constexpr std::size_t kMaxBytes = std::size_t{256} << 20, kMaxPoses = 1'000'000;

/// Rotation of a unit quaternion.
Mat3 rotation_of(double x, double y, double z, double w) {
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),  //
           2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),  //
           2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
}

class Parser {
 public:
  Parser(std::string_view text, const std::string& name) : lines_(text), name_(name) {}

  Result<TrajectoryFile> parse() {
    if (!lines_.next()) return Error{Error::Cause::empty, name_ + ": holds no poses"};
    const auto layout = layout_of(lines_.words().size());
    if (!layout)
      return refuse("holds " + std::to_string(lines_.words().size()) +
                    " words; a line of poses has 8 (time, position, quaternion), 12, 16, or 3 "
                    "before a matrix");
    out_.layout = *layout;
    do {
      if (++count_ > kMaxPoses) return refuse("holds more than 1000000 poses");
      const Status added = out_.layout == Layout::tum ? add_timed() : add_matrix();
      if (!added) return added.error();
    } while (lines_.next());
    return finish();
  }

 private:
  static std::optional<Layout> layout_of(std::size_t words) {
    switch (words) {
      case 8:
        return Layout::tum;
      case 3:
        return Layout::log;
      case 4:
      case 16:
        return Layout::matrix;
      case 12:
        return Layout::matrix34;
      default:
        return std::nullopt;
    }
  }

  Error refuse(const std::string& why) const {
    return {Error::Cause::invalid, name_ + ": line " + std::to_string(lines_.number()) + " " + why};
  }

  /// The numbers of this line, to the end of `out`.
  Status add_numbers(std::vector<double>& out, std::size_t from_word = 0) const {
    for (std::size_t i = from_word; i < lines_.words().size(); ++i) {
      const auto value = number_of(lines_.words()[i]);
      if (!value)
        return refuse("holds " + in_quotes(lines_.words()[i]) + " where a number is wanted");
      out.push_back(*value);
    }
    return {};
  }

  Status wrong_count(std::size_t wanted) const {
    return refuse("holds " + std::to_string(lines_.words().size()) + " words, not " +
                  std::to_string(wanted));
  }

  static bool are_finite(const std::vector<double>& values) {
    return std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
  }

  void lose(const std::string& why) { out_.lost[count_ - 1] = refuse(why); }

  Status add_timed() {
    if (lines_.words().size() != 8) return wrong_count(8);
    const auto at = time_of_seconds(lines_.words()[0]);
    if (!at)
      return refuse("holds " + in_quotes(lines_.words()[0]) + " where a time in seconds is wanted");
    std::vector<double> v;
    if (const Status read = add_numbers(v, 1); !read) return read;
    if (!are_finite(v)) return lose("holds a pose that is not finite"), Status();
    const double length = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
    if (!(std::abs(length - 1) <= 0.01))
      return refuse("holds a quaternion of length " + std::to_string(length) +
                    ", not 1; wanted: time tx ty tz qx qy qz qw");
    const Pose pose{rotation_of(v[3] / length, v[4] / length, v[5] / length, v[6] / length),
                    {v[0], v[1], v[2]}};
    if (is_rigid(pose))
      timed_.push_back({*at, pose});
    else
      lose("holds a pose too far away");
    return {};
  }

  /// A matrix that begins in this line, or behind it in a log.
  Status add_matrix() {
    if (out_.layout == Layout::log) {
      if (lines_.words().size() != 3) return wrong_count(3);
      if (!lines_.next()) return refuse("is the last; a matrix is wanted behind it");
    }
    const std::size_t wanted = out_.layout == Layout::matrix34 ? 12 : 16;
    if (row_ == 0) row_ = wanted == 16 && lines_.words().size() == 4 ? 4 : wanted;
    std::vector<double> matrix;
    while (true) {
      if (lines_.words().size() != row_) return wrong_count(row_);
      if (const Status read = add_numbers(matrix); !read) return read;
      if (matrix.size() == wanted) break;
      if (!lines_.next()) return refuse("is the last, within a matrix");
    }
    if (wanted == 12) matrix.insert(matrix.end(), {0, 0, 0, 1});
    add_pose(matrix);
    return {};
  }

  void add_pose(const std::vector<double>& matrix) {
    auto pose = pose_from_matrix(std::span<const double, 16>(matrix.data(), 16));
    if (pose && !is_rigid(*pose)) pose = Error{Error::Cause::invalid, "pose is too far away"};
    if (!pose) lose("cannot be used: " + pose.error().message);
    out_.by_item.push_back(pose ? *pose : out_.by_item.empty() ? Pose{} : out_.by_item.back());
    if (pose && out_.lost.size() == count_ - 1)  // the first that can be used
      std::fill(out_.by_item.begin(), out_.by_item.end(), *pose);
  }

  Result<TrajectoryFile> finish() {
    if (out_.lost.size() == count_)
      return Error{Error::Cause::invalid,
                   "none of the " + std::to_string(count_) +
                       " poses can be used; first: " + out_.lost.begin()->second.message};
    out_.timed = Trajectory(std::move(timed_));
    return std::move(out_);
  }

  TextLines lines_;
  const std::string& name_;
  TrajectoryFile out_;
  std::vector<TimedPose> timed_;
  std::size_t count_ = 0;  ///< entries so far, with this one
  std::size_t row_ = 0;    ///< numbers in each line of a matrix; 0: not known yet
};

}  // namespace

Result<TrajectoryFile> parse_trajectory(std::string_view text, const std::string& name) {
  return Parser(text, name).parse();
}

Result<TrajectoryFile> read_trajectory_file(const std::filesystem::path& file) {
  const auto text = read_text_file(file, kMaxBytes);
  if (!text) return text.error();
  return parse_trajectory(*text, file.string());
}

}  // namespace mr::sensor
