#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "mr/baseline/waechter.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/kit/topology.h"

namespace mr::baseline {
namespace {

constexpr double kSmooth = 10;     // 1 / lambda of the paper
constexpr double kSeamEdge = 0.5;  // two edges of a seam meet at a vertex
constexpr int kSteps = 4;          // along a seam's edge

/// An edge between two views.
struct Seam {
  std::uint32_t half_edge, twin;
  int view, other;  ///< on the half-edge's side, on the twin's
};

std::vector<Seam> seams_of(const std::vector<std::uint32_t>& twin, std::span<const int> label) {
  std::vector<Seam> out;
  for (std::uint32_t h = 0; h < twin.size(); ++h) {
    if (twin[h] == kit::kNoTwin || twin[h] < h) continue;
    const int a = label[h / 3], b = label[twin[h] / 3];
    if (a >= 0 && b >= 0 && a != b) out.push_back({h, twin[h], a, b});
  }
  return out;
}

Vec3d along(const Mesh& mesh, std::uint32_t half_edge, double share) {
  const Vec3d from = vec_cast<double>(mesh.positions[kit::edge_from(mesh, half_edge)]),
              to = vec_cast<double>(mesh.positions[kit::edge_to(mesh, half_edge)]);
  return from + (to - from) * share;
}

std::uint32_t next_corner(std::uint32_t half_edge) {
  return half_edge / 3 * 3 + (half_edge + 1) % 3;
}

/// A term of a sum: weight · |x[a] - x[b] + offset|².
struct Difference {
  std::uint32_t a, b;
  double weight;
  Vec3d offset;
};

/// What makes the sum of terms least, by conjugate gradients from 0 (Hestenes and Stiefel 1952),
/// with the diagonal as preconditioner.
std::vector<Vec3d> solve_least_squares(std::size_t count, const std::vector<Difference>& terms) {
  constexpr int kMostRounds = 2000;
  constexpr double kEnough = 1e-10;  // of the squared residual
  std::vector<Vec3d> x(count), r(count), z(count), p(count), Ap(count);
  std::vector<double> diagonal(count);
  for (const Difference& s : terms) {
    r[s.a] = r[s.a] - s.offset * s.weight, r[s.b] = r[s.b] + s.offset * s.weight;
    diagonal[s.a] += s.weight, diagonal[s.b] += s.weight;
  }
  const auto product = [&](const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += dot(a[i], b[i]);
    return sum;
  };
  const auto precondition = [&] {
    for (std::size_t i = 0; i < count; ++i) z[i] = diagonal[i] > 0 ? r[i] / diagonal[i] : Vec3d{};
  };
  precondition();
  p = z;
  double rz = product(r, z);
  const double enough = rz * kEnough;
  for (int round = 0; round < kMostRounds && rz > enough; ++round) {
    std::ranges::fill(Ap, Vec3d{});
    for (const Difference& s : terms) {
      const Vec3d by = (p[s.a] - p[s.b]) * s.weight;
      Ap[s.a] = Ap[s.a] + by, Ap[s.b] = Ap[s.b] - by;
    }
    const double step = rz / product(p, Ap);
    for (std::size_t i = 0; i < count; ++i) x[i] = x[i] + p[i] * step, r[i] = r[i] - Ap[i] * step;
    precondition();
    const double before = std::exchange(rz, product(r, z));
    for (std::size_t i = 0; i < count; ++i) p[i] = z[i] + p[i] * (rz / before);
  }
  return x;
}

/// Corners of one vertex and one view are one unknown. [3T]; kNone: no view.
struct Unknowns {
  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;
  std::vector<std::uint32_t> of_corner;
  std::size_t count = 0;

  Unknowns(const Mesh& mesh, std::span<const int> label) {
    of_corner.assign(3 * mesh.triangles.size(), kNone);
    std::vector<std::uint32_t> order(of_corner.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [&](std::uint32_t c) {
      return std::pair(mesh.triangles[c / 3][c % 3], label[c / 3]);
    };
    std::ranges::sort(order, {}, [&](std::uint32_t c) { return std::pair(key(c), c); });
    for (std::size_t i = 0; i < order.size(); ++i) {
      if (label[order[i] / 3] < 0) continue;
      const bool is_same = i > 0 && key(order[i - 1]) == key(order[i]);
      of_corner[order[i]] = static_cast<std::uint32_t>(is_same ? count - 1 : count++);
    }
  }
};

/// The pixels of a view's picture that its triangles cover, and what is added to them.
struct Patch {
  ImageMask mask;
  std::vector<Vec3d> add;  ///< [pixels] 0 beside the mask

  Patch(const Photographed& in, std::span<const int> label, int view)
      : in_(in),
        camera_(in.views[static_cast<std::size_t>(view)].camera()),
        T_camera_world_(in.views[static_cast<std::size_t>(view)].T_world_camera.inverse()) {
    mask = ImageMask(camera_.width, camera_.height);
    add.resize(mask.data.size());
    for (std::uint32_t t = 0; t < label.size(); ++t)
      if (label[t] == view) triangles_.push_back(t);
  }

  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * mask.width + static_cast<std::size_t>(x);
  }
  /// The pixel of a point; nothing beside the picture.
  std::optional<std::array<int, 2>> pixel(Vec3d p_world) const {
    const auto p = project(camera_, T_camera_world_ * p_world);
    if (!p) return std::nullopt;
    const std::array<int, 2> out{static_cast<int>(std::lround(p->x)),
                                 static_cast<int>(std::lround(p->y))};
    return mask.contains(out[0], out[1]) ? std::optional(out) : std::nullopt;
  }
  /// Into how many steps of a pixel at most a segment is divided; at least 1.
  int steps(Vec3d from, Vec3d to) const {
    const auto a = pixel(from), b = pixel(to);
    if (!a || !b) return 1;
    return std::max(std::abs((*a)[0] - (*b)[0]), std::abs((*a)[1] - (*b)[1])) + 1;
  }
  void fill(std::span<const Vec3d> corners);
  void grow();

 private:
  const Photographed& in_;
  Camera camera_;
  Pose T_camera_world_;
  std::vector<std::uint32_t> triangles_;
};

/// Draws the corners' values.
void Patch::fill(std::span<const Vec3d> corners) {
  for (const std::uint32_t t : triangles_) {
    std::array<Vec3d, 3> p;
    std::array<Vec2d, 3> at;
    bool is_whole = true;
    for (int i = 0; i < 3; ++i) {
      p[i] = T_camera_world_ * vec_cast<double>(in_.surface->corner(t, i));
      const auto projected = project(camera_, p[i]);
      is_whole &= projected.has_value();
      if (projected) at[i] = *projected;
    }
    const Vec2d ab = at[1] - at[0], ac = at[2] - at[0];
    const double area = ab.x * ac.y - ab.y * ac.x;
    if (!is_whole || area == 0) continue;
    kit::scan_polygon(kit::clip_to_screen(camera_, p), camera_.width, 0, camera_.height,
                      [&](const kit::ScreenSpan& s) {
                        for (int x = s.first; x <= s.last; ++x) {
                          const Vec2d d = Vec2d{double(x), double(s.y)} - at[0];
                          const double b = (d.x * ac.y - d.y * ac.x) / area,
                                       c = (ab.x * d.y - ab.y * d.x) / area;
                          *mask.at(x, s.y) = 1;
                          add[index(x, s.y)] = corners[3 * t] * (1 - b - c) +
                                               corners[3 * t + 1] * b + corners[3 * t + 2] * c;
                        }
                      });
  }
}

/// A ring of pixels around the mask, which bilinear sampling reaches, gets its neighbours' mean.
void Patch::grow() {
  const ImageMask before = mask;
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) {
      if (*before.at(x, y)) continue;
      Vec3d sum;
      int count = 0;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
          if (before.contains(x + dx, y + dy) && *before.at(x + dx, y + dy))
            sum += add[index(x + dx, y + dy)], ++count;
      if (count > 0) *mask.at(x, y) = 1, add[index(x, y)] = sum / count;
    }
}

/// Half of what is left at the seams, spread over the pixels beside them.
class LocalLevelling {
 public:
  explicit LocalLevelling(const Patch& patch)
      : patch_(patch), sum_(patch.add.size()), samples_(patch.add.size()) {}

  /// What is to be added at a seam's point.
  void add(Vec3d p_world, Vec3d half_difference) {
    const auto p = patch_.pixel(p_world);
    if (!p || !*patch_.mask.at((*p)[0], (*p)[1])) return;
    const std::size_t i = patch_.index((*p)[0], (*p)[1]);
    sum_[i] += half_difference, ++samples_[i];
  }

  /// Solves the Laplace equation between the seams' pixels and those kStrip_px from all of them,
  /// by successive over-relaxation. [pixels]
  std::vector<Vec3d> spread() const {
    constexpr int kRounds = 200;
    constexpr double kOver = 1.8;
    std::vector<Vec3d> out(sum_.size());
    for (std::size_t i = 0; i < out.size(); ++i)
      if (samples_[i] > 0) out[i] = sum_[i] / samples_[i];
    const std::vector<Neighbours> strip = strip_pixels();
    for (int round = 0; round < kRounds; ++round)
      for (const Neighbours& n : strip) {
        Vec3d mean;
        for (int i = 0; i < n.count; ++i) mean += out[n.beside[i]];
        out[n.pixel] += (mean / n.count - out[n.pixel]) * kOver;
      }
    return out;
  }

 private:
  static constexpr int kStrip_px = 20;

  struct Neighbours {
    std::size_t pixel;
    std::array<std::size_t, 4> beside;
    int count;
  };

  Neighbours around(std::size_t i) const {
    const int w = patch_.mask.width, x = static_cast<int>(i) % w, y = static_cast<int>(i) / w;
    Neighbours out{i, {}, 0};
    for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}})
      if (patch_.mask.contains(x + dx, y + dy) && *patch_.mask.at(x + dx, y + dy))
        out.beside[out.count++] = patch_.index(x + dx, y + dy);
    return out;
  }

  /// The mask's pixels under kStrip_px steps from a seam's, without these.
  std::vector<Neighbours> strip_pixels() const {
    std::vector<std::size_t> ring;
    std::vector<std::uint8_t> is_done(samples_.size());
    for (std::size_t i = 0; i < samples_.size(); ++i)
      if (samples_[i] > 0) ring.push_back(i), is_done[i] = 1;
    std::vector<Neighbours> out;
    for (int step = 1; step < kStrip_px; ++step) {
      std::vector<std::size_t> next;
      for (const std::size_t from : ring) {
        const Neighbours n = around(from);
        for (int i = 0; i < n.count; ++i)
          if (!std::exchange(is_done[n.beside[i]], 1)) next.push_back(n.beside[i]);
      }
      for (const std::size_t i : next) out.push_back(around(i));
      ring = std::move(next);
    }
    return out;
  }

  const Patch& patch_;
  std::vector<Vec3d> sum_;
  std::vector<int> samples_;
};

ImageRgb sum_of(const ImageRgb& picture, const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
  ImageRgb out = picture;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (int c = 0; c < 3; ++c)
      out.data[3 * i + c] = static_cast<std::uint8_t>(
          std::clamp(std::lround(picture.data[3 * i + c] + a[i][c] + b[i][c]), 0l, 255l));
  return out;
}

ColorOfView colors_of(const Photographed& in) {
  return [in](int view, Vec3d p_world) -> Vec3d {
    const View& v = in.views[static_cast<std::size_t>(view)];
    const auto pixel = project(v.camera(), v.T_world_camera.inverse() * p_world);
    if (!pixel) return {};
    const auto c = sample_bilinear(*in.pictures[static_cast<std::size_t>(view)], v.image_rect,
                                   pixel->x, pixel->y);
    return {double(c[0]), double(c[1]), double(c[2])};
  };
}

}  // namespace

std::vector<Vec3d> level_seams(const Mesh& surface, std::span<const int> label,
                               const ColorOfView& color) {
  const Unknowns unknown(surface, label);
  const auto twin = kit::edge_table(surface).twin;
  std::vector<Difference> terms;
  for (std::uint32_t h = 0; h < twin.size(); ++h)  // edges within a view, once
    if (label[h / 3] >= 0 &&
        (twin[h] == kit::kNoTwin || h < twin[h] || label[twin[h] / 3] != label[h / 3]))
      terms.push_back({unknown.of_corner[h], unknown.of_corner[next_corner(h)], kSmooth, Vec3d{}});
  for (const Seam& seam : seams_of(twin, label)) {
    Vec3d at_from, at_to;  // means, weighted by nearness
    double weight = 0;
    for (int step = 0; step <= kSteps; ++step) {
      const double share = static_cast<double>(step) / kSteps;
      const Vec3d p = along(surface, seam.half_edge, share);
      const Vec3d difference = color(seam.view, p) - color(seam.other, p);
      at_from += difference * (1 - share), at_to += difference * share, weight += share;
    }
    // The twin runs the other way.
    terms.push_back({unknown.of_corner[seam.half_edge], unknown.of_corner[next_corner(seam.twin)],
                     kSeamEdge, at_from / weight});
    terms.push_back({unknown.of_corner[next_corner(seam.half_edge)], unknown.of_corner[seam.twin],
                     kSeamEdge, at_to / weight});
  }
  const std::vector<Vec3d> solved = solve_least_squares(unknown.count, terms);
  std::vector<Vec3d> out(3 * surface.triangles.size());
  for (std::size_t c = 0; c < out.size(); ++c)
    if (unknown.of_corner[c] != Unknowns::kNone) out[c] = solved[unknown.of_corner[c]];
  return out;
}

std::vector<ImageRgb> levelled_pictures(const Photographed& in, std::span<const int> label) {
  const ColorOfView color = colors_of(in);
  const std::vector<Vec3d> level = level_seams(*in.surface, label, color);
  std::vector<Patch> patches;
  for (std::size_t v = 0; v < in.views.size(); ++v) {
    patches.emplace_back(in, label, static_cast<int>(v));
    patches.back().fill(level);
    for (int ring = 0; ring < 2; ++ring) patches.back().grow();
  }
  std::vector<LocalLevelling> local(patches.begin(), patches.end());
  for (const Seam& seam : seams_of(kit::edge_table(*in.surface).twin, label)) {
    const auto levelled = [&](int view, std::uint32_t from, std::uint32_t to, double share,
                              Vec3d p) {
      return color(view, p) + level[from] * (1 - share) + level[to] * share;
    };
    const Patch &own = patches[static_cast<std::size_t>(seam.view)],
                &other = patches[static_cast<std::size_t>(seam.other)];
    const Vec3d from = along(*in.surface, seam.half_edge, 0),
                to = along(*in.surface, seam.half_edge, 1);
    const int steps = std::max(own.steps(from, to), other.steps(from, to));
    for (int step = 0; step <= steps; ++step) {
      const double share = static_cast<double>(step) / steps;
      const Vec3d p = along(*in.surface, seam.half_edge, share);
      const Vec3d here = levelled(seam.view, seam.half_edge, next_corner(seam.half_edge), share, p);
      const Vec3d there = levelled(seam.other, next_corner(seam.twin), seam.twin, share, p);
      local[static_cast<std::size_t>(seam.view)].add(p, (there - here) / 2);
      local[static_cast<std::size_t>(seam.other)].add(p, (here - there) / 2);
    }
  }
  std::vector<ImageRgb> out(patches.size());
  parallel_for(out.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      out[v] = sum_of(*in.pictures[v], patches[v].add, local[v].spread());
  });
  return out;
}

}  // namespace mr::baseline
