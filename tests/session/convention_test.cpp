// The reference is each engine's own documentation, written out by hand: where its axes point, which way a positive yaw
// turns, and what its camera shows.
#include "server/session/convention.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "server/base/random.h"

namespace sightline {
namespace {

constexpr double kPi = std::numbers::pi;
const double kHalf = std::sqrt(0.5);  // sine and cosine of 45 degrees: half of a right angle

// Numbers in the order x, y, z, w, as engines write them.
glm::dquat quaternion(double x, double y, double z, double w) {
  return {w, x, y, z};
}

void expect_near(const glm::dvec3& got, const glm::dvec3& expected, double tolerance = 1e-12) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(got[i], expected[i], tolerance) << "component " << i;
}

// The directions ahead of, above and to the right of a canonical camera.
glm::dvec3 ahead(const Pose& camera) {
  return camera.rotation * glm::dvec3(0, 0, -1);
}
glm::dvec3 above(const Pose& camera) {
  return camera.rotation * glm::dvec3(0, 1, 0);
}

TEST(Convention, GltfIsTheCanonicalFrame) {
  const Convention c = gltf_convention();
  expect_near(position_from_client(c, {1, 2, 3}), {1, 2, 3});
  const Pose camera = camera_from_client(c, {});
  expect_near(ahead(camera), {0, 0, -1});
  EXPECT_DOUBLE_EQ(fov_from_client(c, 0.7, 16.0 / 9), 0.7);
}

TEST(Convention, GodotDiffersFromGltfByDegrees) {
  const Convention c = godot_convention();
  expect_near(position_from_client(c, {1, 2, 3}), {1, 2, 3});
  expect_near(ahead(camera_from_client(c, {})), {0, 0, -1});
  EXPECT_NEAR(fov_from_client(c, 75, 16.0 / 9), 75 * kPi / 180, 1e-12);
}

TEST(Convention, UnityMirrorsXAndLooksAlongPlusZ) {
  const Convention c = unity_convention();
  expect_near(position_from_client(c, {3, 2, 5}), {-3, 2, 5});
  const Pose camera = camera_from_client(c, {});
  expect_near(ahead(camera), {0, 0, 1});
  expect_near(above(camera), {0, 1, 0});
  // A Unity camera that looks along +Z shows +X to the right. In canonical coordinates that side is -X.
  expect_near(camera.rotation * glm::dvec3(1, 0, 0), {-1, 0, 0});
}

TEST(Convention, UnityYawOf90DegreesTurnsFromNorthToEast) {
  const Convention c = unity_convention();
  const glm::dquat yaw = quaternion(0, kHalf, 0, kHalf);  // Quaternion.Euler(0, 90, 0): +Z goes to +X
  const glm::dvec3 east = position_from_client(c, {1, 0, 0});
  expect_near(rotation_from_client(c, yaw) * position_from_client(c, {0, 0, 1}), east);
  expect_near(ahead(camera_from_client(c, {{0, 0, 0}, yaw})), east);
}

TEST(Convention, UnrealIsInCentimetresWithZUp) {
  const Convention c = unreal_convention();
  expect_near(position_from_client(c, {100, 200, 300}), {1, 3, 2});
  const Pose camera = camera_from_client(c, {});
  expect_near(ahead(camera), {1, 0, 0});
  expect_near(above(camera), {0, 1, 0});
  // Unreal's +Y is to the right of a camera that looks along +X.
  expect_near(camera.rotation * glm::dvec3(1, 0, 0), vector_from_client(c, {0, 100, 0}));
}

TEST(Convention, UnrealYawOf90DegreesTurnsFromXToY) {
  const Convention c = unreal_convention();
  const glm::dquat yaw = quaternion(0, 0, kHalf, kHalf);  // FRotator(0, 90, 0): +X goes to +Y
  expect_near(ahead(camera_from_client(c, {{0, 0, 0}, yaw})), {0, 0, 1});
}

TEST(Convention, UnrealFieldOfViewIsHorizontal) {
  const Convention c = unreal_convention();
  // 90 degrees wide at 16:9: tan(v / 2) = 9 / 16.
  EXPECT_NEAR(fov_from_client(c, 90, 16.0 / 9), 2 * std::atan(9.0 / 16), 1e-12);
  EXPECT_NEAR(fov_to_client(c, 2 * std::atan(9.0 / 16), 16.0 / 9), 90, 1e-9);
}

TEST(Convention, RosHasXForwardYLeftZUp) {
  const Convention c = ros_convention();
  expect_near(position_from_client(c, {1, 2, 3}), {2, 3, 1});
  const Pose camera = camera_from_client(c, {});
  expect_near(ahead(camera), vector_from_client(c, {1, 0, 0}));
  expect_near(above(camera), {0, 1, 0});
  expect_near(camera.rotation * glm::dvec3(1, 0, 0), vector_from_client(c, {0, -1, 0}));  // right is -Y
}

TEST(Convention, RosYawTurnsLeft) {
  const Convention c = ros_convention();
  const glm::dquat yaw = quaternion(0, 0, kHalf, kHalf);
  expect_near(ahead(camera_from_client(c, {{0, 0, 0}, yaw})), vector_from_client(c, {0, 1, 0}));
}

TEST(Convention, AngularVelocityKeepsTheSenseOfTurning) {
  // Turning left seen from above is positive about canonical up. Unity and Unreal count it negative about
  // theirs.
  const glm::dvec3 left(0, 1.5, 0);
  expect_near(angular_velocity_to_client(gltf_convention(), left), {0, 1.5, 0});
  expect_near(angular_velocity_to_client(unity_convention(), left), {0, -1.5, 0});
  expect_near(angular_velocity_to_client(unreal_convention(), left), {0, 0, -1.5});
  expect_near(angular_velocity_to_client(ros_convention(), left), {0, 0, 1.5});
}

TEST(Convention, SizesAndScalesLoseTheirSign) {
  expect_near(extent_from_client(unity_convention(), {1, 2, 3}), {1, 2, 3});
  expect_near(extent_from_client(unreal_convention(), {100, 200, 300}), {1, 3, 2});
  expect_near(scale_from_client(unreal_convention(), {1, 2, 3}), {1, 3, 2});
  expect_near(scale_from_client(ros_convention(), {1, 2, 3}), {2, 3, 1});
}

TEST(Convention, TheOriginIsTakenOffPositionsOnly) {
  Convention c = unity_convention();
  c.origin_m = vector_from_client(c, {10000, 0, 20000});
  expect_near(position_from_client(c, {10001, 2, 20003}), {-1, 2, 3});
  expect_near(position_to_client(c, {-1, 2, 3}), {10001, 2, 20003}, 1e-9);
  expect_near(vector_from_client(c, {1, 2, 3}), {-1, 2, 3});
}

// ---- rules that hold in every convention ----

glm::dvec3 axis(int i) {
  glm::dvec3 a(0.0);
  a[i / 2] = i % 2 ? -1 : 1;
  return a;
}

// All presets, and every signed permutation with some choice of camera axes, scale and origin.
std::vector<Convention> many_conventions() {
  std::vector<Convention> all = {gltf_convention(), godot_convention(), unity_convention(), unreal_convention(),
                                 ros_convention()};
  int k = 0;
  for (int x = 0; x < 6; ++x)
    for (int y = 0; y < 6; ++y)
      for (int z = 0; z < 6; ++z) {
        if (x / 2 == y / 2 || y / 2 == z / 2 || x / 2 == z / 2) continue;
        Convention c;
        c.canonical_from_client = glm::dmat3(axis(x), axis(y), axis(z));
        c.camera_forward = axis(k % 6);
        c.camera_up = axis((k % 6 + 2 + k % 4) % 6);
        c.metres_per_unit = 0.25 * (1 + k % 5);
        c.origin_m = {5.0 * k, -3, 7};
        c.horizontal_fov = k % 2;
        c.degrees = k % 3;
        ++k;
        if (std::abs(glm::dot(c.camera_forward, c.camera_up)) == 0) all.push_back(c);
      }
  return all;
}

glm::dvec3 random_vector(CounterRandom& random) {
  const double x = random.next_in(-9, 9), y = random.next_in(-9, 9), z = random.next_in(-9, 9);
  return {x, y, z};
}

glm::dquat random_rotation(CounterRandom& random) {
  const glm::dvec3 v = random_vector(random);
  return glm::normalize(glm::dquat(random.next_in(-9, 9), v.x, v.y, v.z));
}

Pose random_pose(CounterRandom& random) {
  const glm::dvec3 position = random_vector(random);
  return {position, random_rotation(random)};
}

bool is_left_handed(const Convention& c) {
  return glm::determinant(c.canonical_from_client) < 0;
}

// The right-hand side of the picture in the client's axes.
glm::dvec3 client_right(const Convention& c, const glm::dvec3& forward, const glm::dvec3& up) {
  return is_left_handed(c) ? glm::cross(up, forward) : glm::cross(forward, up);
}

void expect_same_rotation(const glm::dquat& a, const glm::dquat& b) {
  EXPECT_LT(angle_between(a, b), 1e-7);
}

TEST(Convention, ManyAreTried) {
  EXPECT_GT(many_conventions().size(), 40u);
}

TEST(Convention, EverySignedPermutationIsValid) {
  for (const Convention& c : many_conventions()) EXPECT_TRUE(validate(c).has_value());
}

TEST(Convention, ThereAndBackIsTheSame) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  for (const Convention& c : many_conventions()) {
    const Pose pose = random_pose(random);
    expect_near(position_to_client(c, position_from_client(c, pose.position_m)), pose.position_m, 1e-9);
    expect_near(vector_to_client(c, vector_from_client(c, pose.position_m)), pose.position_m, 1e-9);
    expect_same_rotation(rotation_to_client(c, rotation_from_client(c, pose.rotation)), pose.rotation);
    const Pose back = camera_to_client(c, camera_from_client(c, pose));
    expect_near(back.position_m, pose.position_m, 1e-9);
    expect_same_rotation(back.rotation, pose.rotation);
    const double fov = c.degrees ? 77 : 1.3;
    EXPECT_NEAR(fov_to_client(c, fov_from_client(c, fov, 1.6), 1.6), fov, 1e-9);
  }
}

TEST(Convention, APointOfATurnedObjectConvertsAsThePoint) {
  CounterRandom random(2, 0, RandomPurpose::kTest);
  for (const Convention& c : many_conventions()) {
    const Pose client_pose = random_pose(random);
    const glm::dvec3 local = random_vector(random);
    const Pose pose = pose_from_client(c, client_pose);
    expect_near(transform_point(pose, vector_from_client(c, local)),
                position_from_client(c, transform_point(client_pose, local)), 1e-9);
  }
}

TEST(Convention, AScaledPointConvertsAsThePoint) {
  CounterRandom random(3, 0, RandomPurpose::kTest);
  for (const Convention& c : many_conventions()) {
    const glm::dvec3 local = random_vector(random), scale = glm::abs(random_vector(random));
    expect_near(scale_from_client(c, scale) * vector_from_client(c, local), vector_from_client(c, scale * local), 1e-9);
  }
}

TEST(Convention, WhatIsAheadAboveAndRightStaysThere) {
  CounterRandom random(4, 0, RandomPurpose::kTest);
  for (const Convention& c : many_conventions()) {
    const Pose client = random_pose(random);
    const glm::dvec3 forward = client.rotation * c.camera_forward, up = client.rotation * c.camera_up;
    const glm::dvec3 seen = 5.0 * forward + 2.0 * up + 3.0 * client_right(c, forward, up);
    const Pose camera = camera_from_client(c, client);
    const glm::dvec3 in_camera = inverse_transform_point(camera, position_from_client(c, client.position_m + seen));
    expect_near(in_camera, c.metres_per_unit * glm::dvec3(3, 2, -5), 1e-9);
  }
}

TEST(Convention, AngularVelocityIsTheRateOfTheClientsRotations) {
  CounterRandom random(5, 0, RandomPurpose::kTest);
  for (const Convention& c : many_conventions()) {
    const glm::dvec3 w = random_vector(random) * 0.1;
    const glm::dquat start = random_rotation(random);
    const double dt = 1e-4;
    const glm::dquat turned = glm::angleAxis(glm::length(w) * dt, glm::normalize(w)) * start;
    const glm::dquat change = rotation_to_client(c, turned) * glm::conjugate(rotation_to_client(c, start));
    expect_near(2.0 / dt * glm::dvec3(change.x, change.y, change.z), angular_velocity_to_client(c, w), 1e-5);
  }
}

TEST(Convention, TheRelativePoseComposesWithTheTargetsPose) {
  CounterRandom random(6, 0, RandomPurpose::kTest);
  for (const Convention& c : many_conventions()) {
    const Pose target = random_pose(random), camera = random_pose(random);  // canonical, from the world
    const Pose relative = relative_camera_to_client(
        c, {inverse_transform_point(target, camera.position_m), glm::conjugate(target.rotation) * camera.rotation});
    const Pose client_target{position_to_client(c, target.position_m), rotation_to_client(c, target.rotation)};
    const Pose client_camera = camera_to_client(c, camera);
    expect_near(transform_point(client_target, relative.position_m), client_camera.position_m, 1e-9);
    expect_same_rotation(client_target.rotation * relative.rotation, client_camera.rotation);
  }
}

TEST(Convention, AViewLooksAlongItsOwnMinusZ) {
  CounterRandom random(7, 0, RandomPurpose::kTest);
  for (const Convention& c : many_conventions()) {
    const glm::dvec3 eye = random_vector(random);
    const glm::dmat3 world_from_view(random_rotation(random));
    const Pose view = view_to_client(c, eye, world_from_view);
    const glm::dvec3 forward = view.rotation * glm::dvec3(0, 0, -1), up = view.rotation * glm::dvec3(0, 1, 0);
    const glm::dvec3 seen_m = world_from_view * glm::dvec3(0.4, -0.3, -1);  // right, down, ahead
    const glm::dvec3 client = position_to_client(c, eye + seen_m) - view.position_m;
    EXPECT_NEAR(glm::dot(client, forward) * c.metres_per_unit, 1, 1e-9);
    EXPECT_NEAR(glm::dot(client, up) * c.metres_per_unit, -0.3, 1e-9);
    EXPECT_NEAR(glm::dot(client, client_right(c, forward, up)) * c.metres_per_unit, 0.4, 1e-9);
  }
}

// ---- what is refused ----

std::string field_of(const Status& status) {
  return status ? "" : status.error().field;
}

TEST(Convention, NamesWhatIsWrong) {
  Convention twice = gltf_convention();
  twice.canonical_from_client = glm::dmat3({1, 0, 0}, {-1, 0, 0}, {0, 0, 1});
  EXPECT_EQ(field_of(validate(twice)), "convention.custom.y");
  Convention oblique = gltf_convention();
  oblique.canonical_from_client[0] = {kHalf, kHalf, 0};
  EXPECT_EQ(field_of(validate(oblique)), "convention.custom.x");
  Convention flat = gltf_convention();
  flat.canonical_from_client[2] = {0, 1, 0};
  EXPECT_EQ(field_of(validate(flat)), "convention.custom.z");
  Convention lying = gltf_convention();
  lying.camera_up = {0, 0, 1};
  EXPECT_EQ(field_of(validate(lying)), "convention.custom.camera_up");
  for (const double scale : {0.0, -1.0, 1e-7, 2e6, std::nan("")}) {
    Convention scaled = gltf_convention();
    scaled.metres_per_unit = scale;
    EXPECT_EQ(field_of(validate(scaled)), "convention.custom.metres_per_unit") << scale;
  }
  Convention nowhere = gltf_convention();
  nowhere.origin_m.y = std::nan("");
  EXPECT_EQ(field_of(validate(nowhere)), "world_origin");
}

}  // namespace
}  // namespace sightline
