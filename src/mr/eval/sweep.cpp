#include "mr/eval/sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/eval/draw_scene.h"
#include "mr/eval/geometry_buffer.h"

namespace mr::eval {
namespace {

/// Scores of one geometry at one moment: [textures][dividers][views].
using Scores = std::vector<PictureScore>;

bool is_points(const baseline::Geometry& geometry) {
  return std::any_of(geometry.chunks.begin(), geometry.chunks.end(),
                     [](const auto& chunk) { return chunk->point_m > 0; });
}

std::uint64_t triangles_of(const baseline::Geometry& geometry) {
  std::uint64_t sum = 0;
  for (const auto& chunk : geometry.chunks)
    sum += chunk->point_m > 0 ? chunk->mesh.positions.size() : chunk->mesh.triangles.size();
  return sum;
}

/// One sweep under way.
class Sweep {
 public:
  Sweep(System& system, const SweepPlan& plan, const SweepReference& references,
        const Store& scores, const SweepProgress& progress)
      : system_(system),
        plan_(plan),
        references_(references),
        store_(scores),
        progress_(progress) {}

  Result<std::vector<SweepPoint>> run(double fps) {
    const std::size_t points =
        plan_.geometries.size() * plan_.textures.size() * plan_.dividers.size();
    scores_.assign(points, {});
    geometry_rates_.resize(plan_.geometries.size());
    texture_rates_.resize(plan_.textures.size());
    geometry_refresh_.resize(plan_.geometries.size());
    texture_refresh_.resize(plan_.textures.size());
    triangles_.resize(plan_.geometries.size());
    for (std::size_t i = 0; i < references_.moments.size(); ++i)
      if (const Status done = run_moment(i); !done) return done.error();
    return summary(fps);
  }

 private:
  Status run_moment(std::size_t i) {
    const std::size_t moment = references_.moments[i];
    std::vector<std::optional<Scores>> scores;
    for (std::size_t g = 0; g < plan_.geometries.size(); ++g) scores.push_back(kept(i, g));
    const bool all_kept =
        std::all_of(scores.begin(), scores.end(), [](const auto& s) { return s.has_value(); });
    std::vector<LumaTexture> textures;
    if (const Status ready = take_textures(moment, all_kept, textures); !ready) return ready;
    for (std::size_t g = 0; g < plan_.geometries.size(); ++g) {
      auto geometry = system_.geometry(plan_.geometries[g], moment);
      if (!geometry) return geometry.error();
      geometry->cost.add_to(geometry_rates_[g]);
      geometry_refresh_[g] += geometry->cost.refresh_bytes;
      triangles_[g] = triangles_of(geometry->decoded);
      if (!scores[g]) {
        auto made = is_points(geometry->decoded) ? score_points(i, geometry->decoded)
                                                 : score(i, geometry->decoded, textures);
        if (!made) return made.error();
        scores[g] = *std::move(made);
        store_.put(name(i, g), std::as_bytes(std::span(*scores[g])));
      }
      take(g, *scores[g]);
      show_progress(references_.views.size());
    }
    return {};
  }

  /// Decoded where something is to be shaded.
  Status take_textures(std::size_t moment, bool only_rates, std::vector<LumaTexture>& textures) {
    for (std::size_t t = 0; t < plan_.textures.size(); ++t) {
      if (only_rates) {
        const auto cost = system_.texture_cost(plan_.textures[t], moment);
        if (!cost) return cost.error();
        note_texture(t, *cost);
      } else {
        const auto texture = system_.texture(plan_.textures[t], moment);
        if (!texture) return texture.error();
        note_texture(t, texture->cost);
        textures.push_back(luma_texture(texture->decoded));
      }
      show_progress(1);
    }
    return {};
  }

  void note_texture(std::size_t t, const Cost& cost) {
    cost.add_to(texture_rates_[t]);
    texture_refresh_[t] += cost.refresh_bytes;
  }

  std::size_t row() const { return plan_.dividers.size() * references_.views.size(); }

  /// Draws each view once and shades it with every texture; views at once.
  Result<Scores> score(std::size_t moment, const baseline::Geometry& geometry,
                       const std::vector<LumaTexture>& textures) const {
    Scores scores(textures.size() * row());
    std::vector<std::optional<Error>> wrong(references_.views.size());
    parallel_for(references_.views.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        const GeometryBuffer buffer = draw_geometry(geometry, references_.views[v]);
        for (std::size_t t = 0; t < textures.size(); ++t)
          if (const Status ok = compare(moment, v, shade(buffer, textures[t]), buffer.covered,
                                        &scores[t * row()]);
              !ok)
            wrong[v] = ok.error();
      }
    });
    for (const auto& error : wrong)
      if (error) return *error;
    return scores;
  }

  /// Points carry their colours: one picture, whatever the texture.
  Result<Scores> score_points(std::size_t moment, const baseline::Geometry& geometry) const {
    auto renderer = render::Renderer::create();
    if (!renderer) return renderer.error();
    DecodedScene scene;
    scene.chunks = geometry.chunks;
    Scores scores(row());
    for (std::size_t v = 0; v < references_.views.size(); ++v) {
      const auto drawn = draw_scene(*renderer, scene, references_.views[v]);
      if (!drawn) return drawn.error();
      if (const Status ok =
              compare(moment, v, luma_of(drawn->color), drawn->covered, scores.data());
          !ok)
        return ok.error();
    }
    Scores all;
    for (std::size_t t = 0; t < plan_.textures.size(); ++t)
      all.insert(all.end(), scores.begin(), scores.end());
    return all;
  }

  /// `scores`: [dividers][views].
  Status compare(std::size_t moment, std::size_t view, const ImageLuma& luma,
                 const ImageMask& covered, PictureScore* scores) const {
    for (std::size_t d = 0; d < plan_.dividers.size(); ++d) {
      const auto result = references_.by_divider.at(d).compare(moment, view, luma, covered);
      if (!result) return result.error();
      scores[d * references_.views.size() + view] = *result;
    }
    return {};
  }

  std::string name(std::size_t moment, std::size_t g) const {
    Fingerprint print;
    for (const TextureSetting& texture : plan_.textures) print.add(to_string(texture));
    for (const int divider : plan_.dividers) print.add(divider);
    return fmt::format("scores-{}-{}-{}", references_.moments[moment],
                       to_string(plan_.geometries[g]), print.hex());
  }

  std::optional<Scores> kept(std::size_t moment, std::size_t g) const {
    const auto bytes = store_.get(name(moment, g));
    Scores scores(plan_.textures.size() * row());
    if (!bytes || bytes->size() != scores.size() * sizeof(PictureScore)) return std::nullopt;
    std::memcpy(scores.data(), bytes->data(), bytes->size());
    return scores;
  }

  void take(std::size_t g, const Scores& scores) {
    const std::size_t views = references_.views.size();
    for (std::size_t td = 0; td < plan_.textures.size() * plan_.dividers.size(); ++td) {
      const PictureScore* of = &scores[td * views];
      scores_[g * plan_.textures.size() * plan_.dividers.size() + td].emplace_back(of, of + views);
    }
  }

  std::vector<SweepPoint> summary(double fps) const {
    std::vector<SweepPoint> points;
    for (std::size_t g = 0; g < plan_.geometries.size(); ++g)
      for (std::size_t t = 0; t < plan_.textures.size(); ++t)
        for (const int divider : plan_.dividers) {
          SweepPoint point;
          point.geometry = plan_.geometries[g], point.texture = plan_.textures[t];
          point.divider = divider, point.triangles = triangles_[g];
          point.geometry_mbps = geometry_rates_[g].mbps(fps / divider);
          point.texture_mbps = texture_rates_[t].mbps(fps / divider);
          point.refresh_mbps = (geometry_refresh_[g] + texture_refresh_[t]) * 8e-6 /
                               static_cast<double>(references_.moments.size());
          point.score = summarize(scores_[points.size()]);
          points.push_back(std::move(point));
        }
    return points;
  }

  void show_progress(std::size_t more) {
    done_ += more;
    const std::size_t of =
        references_.moments.size() *
        (plan_.textures.size() + plan_.geometries.size() * references_.views.size());
    if (progress_) progress_(done_, of);
  }

  System& system_;
  const SweepPlan& plan_;
  const SweepReference& references_;
  const Store& store_;
  const SweepProgress& progress_;
  std::vector<std::vector<std::vector<PictureScore>>> scores_;  // [points][moments][views]
  std::vector<Rate> geometry_rates_, texture_rates_;
  std::vector<double> geometry_refresh_, texture_refresh_;  // bytes, summed over moments
  std::vector<std::uint64_t> triangles_;
  std::size_t done_ = 0;
};

}  // namespace

Result<std::vector<SweepPoint>> sweep(System& system, const SweepPlan& plan,
                                      const SweepReference& references, double fps,
                                      const Store& scores, const SweepProgress& progress) {
  return Sweep(system, plan, references, scores, progress).run(fps);
}

}  // namespace mr::eval
