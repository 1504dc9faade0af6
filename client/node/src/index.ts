// A client of Sightline: one camera that keeps its targets in view, tick by tick. README.md shows a complete program; proto/sightline/v1
// describes every field. Ids and hashes are bigint.
export {Camera, type Options} from "./camera.js";
export type {Source} from "./display.js";
export {Failed, QueueFull, Refused, type Violation} from "./errors.js";
export {LiveCamera, type LiveOptions, type LiveView} from "./live.js";
export {PoseSampler, type Sample} from "./sampler.js";
export {box, capsule, instance, sphere, transforms, vector, type Quaternion, type Vector} from "./shapes.js";
export type {Tls, Trust} from "./stream.js";
export * from "./gen/sightline/v1/camera_control_pb.js";
export * from "./gen/sightline/v1/camera_pb.js";
export * from "./gen/sightline/v1/diagnostics_pb.js";
export * from "./gen/sightline/v1/errors_pb.js";
export * from "./gen/sightline/v1/scene_pb.js";
export * from "./gen/sightline/v1/session_pb.js";
export * from "./gen/sightline/v1/settings_pb.js";
export * from "./gen/sightline/v1/shot_pb.js";
export * from "./gen/sightline/tuning/v1alpha1/tuning_pb.js";
