// One query of Embree, with version 3 or 4: its flags, its filter, and the instance that a filter is called for.
// Version 3 keeps all of them in the context, version 4 takes flags and filter beside it. Internal to sample/embree_*,
// and the only header that includes Embree.
#pragma once

#ifdef SIGHTLINE_EMBREE_4  // the version that CMake found
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace sightline {

// Embree hands the address of `embree` to the filter. Members of ours that follow a QueryContext at the head of a
// struct are found by it.
struct QueryContext {
#if RTC_VERSION_MAJOR >= 4
  RTCRayQueryContext embree;  // must stay first
  RTCRayQueryFlags flags = RTC_RAY_QUERY_FLAG_INCOHERENT;
  RTCFilterFunctionN filter = nullptr;

  QueryContext() {
    rtcInitRayQueryContext(&embree);
  }
  void expect_coherent_rays() {
    flags = static_cast<RTCRayQueryFlags>(flags | RTC_RAY_QUERY_FLAG_COHERENT);
  }
  void filter_by(RTCFilterFunctionN function) {
    filter = function;
    flags = static_cast<RTCRayQueryFlags>(flags | RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER);
  }

  void intersect(RTCScene scene, RTCRayHit& ray) {
    RTCIntersectArguments arguments = intersect_arguments();
    rtcIntersect1(scene, &ray, &arguments);
  }
  void intersect(const int* valid, RTCScene scene, RTCRayHit16& rays) {
    RTCIntersectArguments arguments = intersect_arguments();
    rtcIntersect16(valid, scene, &rays, &arguments);
  }
  void occluded(RTCScene scene, RTCRay& ray) {
    RTCOccludedArguments arguments;
    rtcInitOccludedArguments(&arguments);
    arguments.flags = flags;
    arguments.context = &embree;
    arguments.filter = filter;
    rtcOccluded1(scene, &ray, &arguments);
  }

 private:
  RTCIntersectArguments intersect_arguments() {
    RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.flags = flags;
    arguments.context = &embree;
    arguments.filter = filter;
    return arguments;
  }
#else
  RTCIntersectContext embree;  // must stay first

  QueryContext() {
    rtcInitIntersectContext(&embree);
  }
  void expect_coherent_rays() {
    embree.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  }
  void filter_by(RTCFilterFunctionN function) {
    embree.filter = function;
  }

  void intersect(RTCScene scene, RTCRayHit& ray) {
    rtcIntersect1(scene, &embree, &ray);
  }
  void intersect(const int* valid, RTCScene scene, RTCRayHit16& rays) {
    rtcIntersect16(valid, scene, &embree, &rays);
  }
  void occluded(RTCScene scene, RTCRay& ray) {
    rtcOccluded1(scene, &embree, &ray);
  }
#endif
};

// The flag of scenes whose queries may have a filter.
#if RTC_VERSION_MAJOR >= 4
constexpr RTCSceneFlags kFilterByQuery = RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
#else
constexpr RTCSceneFlags kFilterByQuery = RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;
#endif

}  // namespace sightline
