#include "mr/kit/raycast.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <tuple>

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

/// Adds a copy of `mesh` as geometry number `place`.
void attach(RTCScene scene, const Mesh& mesh, unsigned place) {
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

}  // namespace

struct RayScene::Impl {
  Impl() : scene(rtcNewScene(device())) {}
  ~Impl() { rtcReleaseScene(scene); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  RTCScene scene;
};

RayScene::RayScene(std::span<const Mesh* const> meshes) : impl_(std::make_unique<Impl>()) {
  rtcSetSceneFlags(
      impl_->scene,
      static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  for (unsigned i = 0; i < meshes.size(); ++i)
    if (!meshes[i]->empty()) attach(impl_->scene, *meshes[i], i);
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

}  // namespace mr::kit
