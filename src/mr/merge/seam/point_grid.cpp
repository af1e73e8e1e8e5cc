#include "mr/merge/seam/point_grid.h"

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::merge {
namespace {

/// Maps floats to integers with the same order.
std::uint32_t sortable(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

/// Stable radix sort of the points' indices by x.
std::vector<std::uint32_t> order_along_x(std::span<const Vec3f> points) {
  constexpr int kBits = 11, kPasses = 3;
  constexpr std::uint32_t kMask = (1u << kBits) - 1;
  struct Key {
    std::uint32_t x, place;
  };
  std::vector<Key> keys(points.size()), sorted(points.size());
  std::array<std::array<std::uint32_t, kMask + 1>, kPasses> next{};
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    keys[i] = {sortable(points[i].x), i};
    for (int pass = 0; pass < kPasses; ++pass) ++next[pass][keys[i].x >> pass * kBits & kMask];
  }
  for (int pass = 0; pass < kPasses; ++pass) {
    std::exclusive_scan(next[pass].begin(), next[pass].end(), next[pass].begin(), 0u);
    for (const Key key : keys) sorted[next[pass][key.x >> pass * kBits & kMask]++] = key;
    std::swap(keys, sorted);
  }
  std::vector<std::uint32_t> out(points.size());
  std::ranges::transform(keys, out.begin(), &Key::place);
  return out;
}

}  // namespace

PointGrid::PointGrid(std::span<const Vec3f> points, double cell_m) {
  if (points.empty()) return;
  Box3f box;
  for (const Vec3f p : points) box.add(p);
  set_size(box, points.size(), cell_m);
  sort_into_rows(points);
}

void PointGrid::set_size(const Box3f& box, std::size_t points, double cell_m) {
  const double most_rows = 65536 + 16.0 * static_cast<double>(points);
  const Vec3d size = vec_cast<double>(box.high) - vec_cast<double>(box.low);
  const Vec3f far = max(box.high, -box.low);
  slack_m_ = 1e-6f * std::max({far.x, far.y, far.z});
  double apart_m =
      std::max(cell_m * 1.0001 + 2 * slack_m_, 1e-9);  // so that a radius of one cell is one row's
  const auto rows = [&] { return (size.y / apart_m + 1) * (size.z / apart_m + 1); };
  while (rows() > most_rows) apart_m *= 1.25;
  low_ = box.low, per_cell_ = static_cast<float>(1 / apart_m);
  rows_y_ = static_cast<int>(size.y / apart_m) + 1;
  rows_z_ = static_cast<int>(size.z / apart_m) + 1;
}

/// Stable counting sort by row of points that are sorted along x.
void PointGrid::sort_into_rows(std::span<const Vec3f> points) {
  std::vector<std::uint32_t> row(points.size());
  first_.assign(static_cast<std::size_t>(rows_y_) * rows_z_ + 1, 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    row[i] = row_of(points[i].y, points[i].z);
    ++first_[row[i] + 1];
  }
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  points_.resize(points.size());
  for (const std::uint32_t i : order_along_x(points)) {
    points_[first_[row[i]]++] = {points[i], i};
  }
  std::shift_right(first_.begin(), first_.end(), 1);  // each had gone to the next one's begin
  first_[0] = 0;
}

/// Finds the neighbours of the points of one row after another. Batches consecutive points:
/// candidates for the whole batch are copied into an array once, and each point is compared with
/// all of them by branchless SIMD.
class PointGrid::Matcher {
 public:
  /// `tags`: in the grid's order.
  Matcher(const PointGrid& grid, const std::vector<std::uint32_t>& tags, float radius_m)
      : grid_(grid), tags_(tags), radius_m_(radius_m) {
    const double rows = (static_cast<double>(radius_m) + grid.slack_m_) * grid.per_cell_;
    reach_ = static_cast<int>(std::ceil(std::min(rows, 1e9)));
  }

  /// Of the points from `begin` to `end` of the grid's order.
  void run(std::uint32_t begin, std::uint32_t end, std::vector<Match>& out) {
    for (std::uint32_t i = begin; i < end;) {
      const std::uint32_t row_end = std::min(end, open_row(i));
      while (i < row_end) {
        const float x = grid_.points_[i].at.x;
        std::uint32_t next = i + 1;
        const auto is_beside = [&](float radii) {
          return next < row_end && grid_.points_[next].at.x - x < radii * radius_m_;
        };
        while (is_beside(next < i + kFewTogether ? 8 : 1)) ++next;
        gather(i, next);
        for (; i < next; ++i) out[grid_.points_[i].place] = match(i);
      }
    }
  }

 private:
  /// Points beside each other in the grid's order that may be near. In a long row they follow the
  /// points in the middle along x.
  struct Window {
    std::uint32_t from = 0, end = 0;
    bool follows = false;
  };

  /// Finds the rows that points of point i's row reach. Returns that row's end.
  std::uint32_t open_row(std::uint32_t i) {
    const Vec3f at = grid_.points_[i].at;
    const int y = grid_.cell(at.y, grid_.low_.y, grid_.rows_y_),
              z = grid_.cell(at.z, grid_.low_.z, grid_.rows_z_);
    const int low_y = std::max(y - reach_, 0), low_z = std::max(z - reach_, 0);
    const int high_y = reach_ < grid_.rows_y_ - y ? y + reach_ : grid_.rows_y_ - 1,
              high_z = reach_ < grid_.rows_z_ - z ? z + reach_ : grid_.rows_z_ - 1;
    windows_.clear();
    std::size_t most = kLanes;
    for (int b = low_z; b <= high_z; ++b) {
      const std::uint32_t first = grid_.row_number(low_y, b), last = grid_.row_number(high_y, b);
      const std::uint32_t from = grid_.first_[first], end = grid_.first_[last + 1];
      most += end - from;
      if (end - from > kFew)
        open_rows(first, last, at.x);
      else if (from < end)
        windows_.push_back({from, end, false});
    }
    if (most > x_.size()) {
      for (auto* lane : {&x_, &y_, &z_}) lane->resize(2 * most);
      for (auto* lane : {&at_, &tag_}) lane->resize(2 * most);
      square_.resize(2 * most);
    }
    return grid_.first_[grid_.row_number(y, z) + 1];
  }

  void open_rows(std::uint32_t first, std::uint32_t last, float x) {
    for (std::uint32_t row = first; row <= last; ++row)
      if (const std::uint32_t end = grid_.first_[row + 1]; grid_.first_[row] < end)
        windows_.push_back({grid_.first_not_left(row, x, radius_m_), end, true});
  }

  /// Copies out what may be near any of the points from `begin` to `end`, which lie in one row, and
  /// fills up with points that are near nothing.
  void gather(std::uint32_t begin, std::uint32_t end) {
    const Point* points = grid_.points_.data();
    const float low_x = points[begin].at.x, high_x = points[end - 1].at.x;
    count_ = 0;
    for (Window& window : windows_) {
      std::uint32_t k = window.from, last = window.end;
      if (window.follows) {
        while (k < last && points[k].at.x - low_x <= -radius_m_) ++k;
        window.from = k;
        for (last = k; last < window.end && points[last].at.x - high_x < radius_m_;) ++last;
      }
      copy(k, last);
    }
    constexpr float kFar = std::numeric_limits<float>::infinity();
    for (; count_ % kLanes != 0; ++count_)
      x_[count_] = kFar, y_[count_] = z_[count_] = 0, tag_[count_] = 0;
  }

  void copy(std::uint32_t begin, std::uint32_t end) {
    const Point* points = grid_.points_.data();
    const std::uint32_t* tags = tags_.data();
    float *x = x_.data() + count_, *y = y_.data() + count_, *z = z_.data() + count_;
    std::uint32_t *at = at_.data() + count_, *tag = tag_.data() + count_;
    const std::uint32_t n = end - begin;
    for (std::uint32_t k = 0; k < n; ++k) {
      const Point point = points[begin + k];
      x[k] = point.at.x, y[k] = point.at.y, z[k] = point.at.z;
      at[k] = point.place, tag[k] = tags[begin + k];
    }
    count_ += n;
  }

  Match match(std::uint32_t i) {
    const Vec3f middle = grid_.points_[i].at;
    const std::uint32_t own = tags_[i];
    const auto limit = std::bit_cast<std::int32_t>(radius_m_ * radius_m_);
    const float *x = x_.data(), *y = y_.data(), *z = z_.data();
    const std::uint32_t* tag = tag_.data();
    std::int32_t* squares = square_.data();
    std::uint32_t found = 0;
    std::int32_t least = limit;
    const std::size_t n = count_ / kLanes * kLanes;
    for (std::size_t k = 0; k < n; ++k) {
      const Vec3f d{x[k] - middle.x, y[k] - middle.y, z[k] - middle.z};
      const auto square = std::bit_cast<std::int32_t>(dot(d, d));  // in the order of the floats
      squares[k] = square;
      found += square < limit;
      least = std::min(least, tag[k] == own ? limit : square);
    }
    Match out{found - 1, Match::kNone, 0};  // it found itself, too
    if (least == limit) return out;
    for (std::size_t k = 0; k < n; ++k)
      if (squares[k] == least && tag[k] != own) out.nearest = std::min(out.nearest, at_[k]);
    out.distance_m = std::sqrt(std::bit_cast<float>(least));
    return out;
  }

  static constexpr std::uint32_t kFew = 32;
  static constexpr std::size_t kLanes = 8;
  static constexpr std::uint32_t kFewTogether = 8;  // so many may lie farther apart

  const PointGrid& grid_;
  const std::vector<std::uint32_t>& tags_;
  const float radius_m_;
  int reach_ = 1;  // rows
  std::vector<Window> windows_;
  std::size_t count_ = 0;  // of those copied out
  std::vector<float> x_, y_, z_;
  std::vector<std::uint32_t> at_, tag_;  // at_: places
  std::vector<std::int32_t> square_;     // of distances, as their floats' bits
};

std::vector<PointGrid::Match> PointGrid::match(std::span<const std::uint32_t> tags,
                                               float radius_m) const {
  constexpr std::size_t kGrain = 1024;
  MR_ASSERT(tags.size() == points_.size() && radius_m > 0);
  std::vector<std::uint32_t> sorted_tags(tags.size());
  for (std::size_t i = 0; i < tags.size(); ++i) sorted_tags[i] = tags[points_[i].place];
  std::vector<Match> out(tags.size());
  parallel_for(tags.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    Matcher(*this, sorted_tags, radius_m)
        .run(static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end), out);
  });
  return out;
}

}  // namespace mr::merge
