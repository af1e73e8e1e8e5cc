#include "mr/kit/raycast.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <tuple>
#include <utility>

namespace mr::kit {
namespace {

/// The process's one Embree device. Default configuration: naming a thread count here would limit
/// TBB for the whole process. Never released, so that scenes may outlive static destruction.
RTCDevice device() {
  static const RTCDevice shared = rtcNewDevice(nullptr);
  if (shared == nullptr) {
    std::fprintf(stderr, "mr: cannot create an Embree device (error %d)\n",
                 static_cast<int>(rtcGetDeviceError(nullptr)));
    std::abort();
  }
  return shared;
}

/// Embree's copy of a mesh; lives as long as its scene.
struct MeshCopy {
  const Vec3f* positions = nullptr;
  const Triangle* triangles = nullptr;
};

/// Adds a copy of `mesh` as geometry number `place`.
MeshCopy attach(RTCScene scene, const Mesh& mesh, unsigned place) {
  const RTCGeometry geometry = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_TRIANGLE);
  void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                           sizeof(Vec3f), mesh.positions.size());
  void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                          sizeof(Triangle), mesh.triangles.size());
  if (vertices == nullptr || indices == nullptr) {
    rtcReleaseGeometry(geometry);
    throw std::bad_alloc();
  }
  std::memcpy(vertices, mesh.positions.data(), mesh.positions.size() * sizeof(Vec3f));
  std::memcpy(indices, mesh.triangles.data(), mesh.triangles.size() * sizeof(Triangle));
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene, geometry, place);
  rtcReleaseGeometry(geometry);
  return {static_cast<const Vec3f*>(vertices), static_cast<const Triangle*>(indices)};
}

bool before(const RayHit& a, const RayHit& b) {
  return std::tie(a.distance, a.mesh, a.triangle) < std::tie(b.distance, b.mesh, b.triangle);
}

RayHit candidate(const RTCFilterFunctionNArguments* args) {
  return {RTCRayN_tfar(args->ray, args->N, 0), RTCHitN_geomID(args->hit, args->N, 0),
          RTCHitN_primID(args->hit, args->N, 0)};
}

/// Embree hands the context on to the filter, which finds the caller's data behind it.
template <typename Data>
struct Query {
  RTCIntersectContext context;
  Data data;
};

template <typename Data>
Data& data_of(const RTCFilterFunctionNArguments* args) {
  return reinterpret_cast<Query<Data>*>(args->context)->data;
}

/// Notes the hit and refuses it, so that the ray goes on.
void collect(const RTCFilterFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  data_of<std::vector<RayHit>*>(args)->push_back(candidate(args));
  args->valid[0] = 0;
}

/// Takes the smallest hit in the order of before(): of hits at the same distance the choice must
/// not depend on how the tree was built.
void keep_first(const RTCFilterFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  std::optional<RayHit>& best = data_of<std::optional<RayHit>>(args);
  const RayHit hit = candidate(args);
  if (!best || before(hit, *best))
    best = hit;
  else
    args->valid[0] = 0;
}

/// Casts one ray. Embree wants near >= 0, so a ray that begins behind its origin is moved;
/// returns how far, to be added to the distances.
template <typename Data>
float cast(RTCScene scene, Query<Data>& query, RTCFilterFunctionN filter, Vec3f origin,
           Vec3f direction, float near, float far) {
  const float shift = near < 0 ? near : 0;
  if (shift < 0) origin += direction * shift;
  rtcInitIntersectContext(&query.context);
  query.context.filter = filter;
  RTCRayHit ray{};
  ray.ray.org_x = origin.x, ray.ray.org_y = origin.y, ray.ray.org_z = origin.z;
  ray.ray.dir_x = direction.x, ray.ray.dir_y = direction.y, ray.ray.dir_z = direction.z;
  ray.ray.tnear = near - shift, ray.ray.tfar = far - shift;
  ray.ray.mask = 0xFFFFFFFFu;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene, &query.context, &ray);
  return shift;
}

bool is_castable(Vec3f origin, Vec3f direction, float near, float far) {
  return is_finite(origin) && is_finite(direction) && dot(direction, direction) > 0 && near <= far;
}

/// The nearest point so far.
struct Search {
  const MeshCopy* meshes;
  Vec3d from;
  double squared;  ///< what is farther is of no interest
  std::optional<NearestPoint> best;
};

/// A little more than a distance, so that Embree's float boxes keep what is equally far away.
float reach(double distance) { return static_cast<float>(std::max(distance * 1.00001, 1e-9)); }

/// Embree offers a triangle that may be near enough.
bool consider(RTCPointQueryFunctionArguments* args) {
  Search& search = *static_cast<Search*>(args->userPtr);
  const auto [positions, triangles] = search.meshes[args->geomID];
  const auto [a, b, c] = triangles[args->primID];
  const Vec3d point =
      nearest_on_triangle(search.from, vec_cast<double>(positions[a]),
                          vec_cast<double>(positions[b]), vec_cast<double>(positions[c]));
  const double squared = dot(point - search.from, point - search.from);
  if (squared > search.squared) return false;
  if (search.best && squared == search.squared &&
      std::tie(search.best->mesh, search.best->triangle) < std::tie(args->geomID, args->primID))
    return false;
  search.best = NearestPoint{point, std::sqrt(squared), args->geomID, args->primID};
  search.squared = squared;
  args->query->radius = std::min(args->query->radius, reach(search.best->distance_m));
  return true;
}

}  // namespace

Vec3d nearest_on_segment(Vec3d p, Vec3d a, Vec3d b) {
  const Vec3d along = b - a;
  const double squared = dot(along, along);
  if (squared == 0) return a;
  const double t = dot(p - a, along) / squared;
  return t <= 0 ? a : t >= 1 ? b : a + along * t;
}

Vec3d nearest_on_triangle(Vec3d p, Vec3d a, Vec3d b, Vec3d c) {
  const Vec3d normal = cross(b - a, c - a);
  const double squared = dot(normal, normal);
  // The foot of the perpendicular, where it lies inside all three sides.
  if (squared > 0 && dot(cross(b - a, p - a), normal) >= 0 &&
      dot(cross(c - b, p - b), normal) >= 0 && dot(cross(a - c, p - c), normal) >= 0)
    return p - normal * (dot(p - a, normal) / squared);
  Vec3d best = nearest_on_segment(p, a, b);
  for (const auto& [from, to] : {std::pair(b, c), std::pair(c, a)}) {
    const Vec3d point = nearest_on_segment(p, from, to);
    if (dot(point - p, point - p) < dot(best - p, best - p)) best = point;
  }
  return best;
}

struct RayScene::Impl {
  Impl() : scene(rtcNewScene(device())) {}
  ~Impl() { rtcReleaseScene(scene); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  RTCScene scene;
  std::vector<MeshCopy> meshes;  ///< by place
};

RayScene::RayScene(std::span<const Mesh* const> meshes) : impl_(std::make_unique<Impl>()) {
  rtcSetSceneFlags(
      impl_->scene,
      static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  impl_->meshes.resize(meshes.size());
  for (unsigned i = 0; i < meshes.size(); ++i)
    if (!meshes[i]->empty()) impl_->meshes[i] = attach(impl_->scene, *meshes[i], i);
  rtcCommitScene(impl_->scene);  // runs in the caller's arena
}

RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;

void RayScene::all_hits(Vec3f origin, Vec3f direction, float near, float far,
                        std::vector<RayHit>& hits) const {
  hits.clear();
  if (!is_castable(origin, direction, near, far)) return;
  Query<std::vector<RayHit>*> query{{}, &hits};
  const float shift = cast(impl_->scene, query, &collect, origin, direction, near, far);
  std::sort(hits.begin(), hits.end(), &before);
  // Embree may offer a triangle more than once.
  const auto same = [](const RayHit& a, const RayHit& b) {
    return a.mesh == b.mesh && a.triangle == b.triangle;
  };
  hits.erase(std::unique(hits.begin(), hits.end(), same), hits.end());
  for (RayHit& hit : hits) hit.distance += shift;
}

std::optional<RayHit> RayScene::first_hit(Vec3f origin, Vec3f direction, float near,
                                          float far) const {
  if (!is_castable(origin, direction, near, far)) return std::nullopt;
  Query<std::optional<RayHit>> query{};
  const float shift = cast(impl_->scene, query, &keep_first, origin, direction, near, far);
  if (query.data) query.data->distance += shift;
  return query.data;
}

std::optional<NearestPoint> RayScene::nearest(Vec3f from, float within_m) const {
  if (!is_finite(from) || !(within_m >= 0)) return std::nullopt;
  const double within = within_m;
  Search search{impl_->meshes.data(), vec_cast<double>(from), within * within, std::nullopt};
  RTCPointQuery query{};
  query.x = from.x, query.y = from.y, query.z = from.z;
  query.radius = reach(within);
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(impl_->scene, &query, &context, &consider, &search);
  return search.best;
}

}  // namespace mr::kit
