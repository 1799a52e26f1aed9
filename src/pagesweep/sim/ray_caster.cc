// SPDX-License-Identifier: Apache-2.0
#include "pagesweep/sim/ray_caster.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <limits>
#include <stdexcept>

#include "pagesweep/base/parallel.h"

namespace pagesweep::sim {
namespace {

constexpr std::size_t rays_at_a_time = 64;

RTCGeometry make_geometry(RTCDevice device, const GridMesh& mesh) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), mesh.nodes()));
  for (const Eigen::Vector3d& point : mesh.positions.pixels())
    for (int axis = 0; axis < 3; ++axis) *vertices++ = static_cast<float>(point[axis]);
  const auto triangles = static_cast<std::uint32_t>(mesh.triangle_count());
  auto* indices = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), triangles));
  for (std::uint32_t k = 0; k < triangles; ++k)
    for (const std::uint32_t node : mesh.triangle(k))
      *indices++ = mesh.is_missing(k) ? 0 : node;  // three times the same node: met by no ray
  rtcCommitGeometry(geometry);
  return geometry;
}

RTCRay make_ray(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float far) {
  RTCRay ray{};
  ray.org_x = origin.x(), ray.org_y = origin.y(), ray.org_z = origin.z();
  ray.dir_x = direction.x(), ray.dir_y = direction.y(), ray.dir_z = direction.z();
  ray.tfar = far;
  ray.mask = ~0u;
  return ray;
}

}  // namespace

struct RayCaster::Embree {
  // Not "threads=1": while such a device lives, Embree holds all TBB work of the process to one thread.
  RTCDevice device = rtcNewDevice("set_affinity=0");
  RTCScene scene = nullptr;
  Embree() {
    if (!device) throw std::runtime_error("Embree cannot run on this machine");
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  }
  ~Embree() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
};

RayCaster::RayCaster(std::vector<const GridMesh*> surfaces)
    : surfaces_(std::move(surfaces)), embree_(std::make_unique<Embree>()) {
  for (std::size_t k = 0; k < surfaces_.size(); ++k) {
    RTCGeometry geometry = make_geometry(embree_->device, *surfaces_[k]);
    rtcAttachGeometryByID(embree_->scene, geometry, static_cast<unsigned>(k));
    rtcReleaseGeometry(geometry);
  }
  {
    // One thread builds, so that the tree, and with it which of two triangles owns a common edge, is always the same.
    const ThreadLimit one_thread(1);
    rtcCommitScene(embree_->scene);
  }
  if (rtcGetDeviceError(embree_->device) != RTC_ERROR_NONE)
    throw std::runtime_error("Embree could not build the scene");
}

RayCaster::~RayCaster() = default;
RayCaster::RayCaster(RayCaster&&) noexcept = default;

void RayCaster::cast(std::span<const SimRay> rays, std::span<SimHit> hits) const {
  std::array<RTCRayHit, rays_at_a_time> queries;
  for (std::size_t begin = 0; begin < rays.size(); begin += rays_at_a_time) {
    const std::size_t count = std::min(rays_at_a_time, rays.size() - begin);
    for (std::size_t k = 0; k < count; ++k) {
      const SimRay& ray = rays[begin + k];
      queries[k].ray = make_ray(ray.origin, ray.direction, std::numeric_limits<float>::infinity());
      queries[k].hit.geomID = queries[k].hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect1M(embree_->scene, &context, queries.data(), static_cast<unsigned>(count), sizeof(RTCRayHit));
    for (std::size_t k = 0; k < count; ++k) {
      const RTCHit& hit = queries[k].hit;
      SimHit& result = hits[begin + k];
      result.surface = hit.geomID == RTC_INVALID_GEOMETRY_ID ? -1 : static_cast<int>(hit.geomID);
      if (result.surface < 0) continue;
      result.spot = {surfaces_[hit.geomID]->triangle(hit.primID), {1 - hit.u - hit.v, hit.u, hit.v}};
    }
  }
}

SimHit RayCaster::cast(const SimRay& ray) const {
  SimHit hit;
  cast({&ray, 1}, {&hit, 1});
  return hit;
}

bool RayCaster::blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const {
  RTCRay ray = make_ray(from, to - from, 0.9999f);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(embree_->scene, &context, &ray);
  return ray.tfar < 0;
}

}  // namespace pagesweep::sim
