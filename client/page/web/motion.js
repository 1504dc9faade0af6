// How the camera moves and how large the targets are in its picture: computed from the poses, a number a frame. A cut is no motion.

// Position, speed, acceleration: each is the former's difference over time. NaN where a cut or a pause stands between.
function differences(values, time_s, cut) {
  const out = new Float64Array(values.length).fill(NaN);
  for (let frame = 3; frame < values.length; frame += 3) {
    const k = frame / 3,
      dt = time_s[k] - time_s[k - 1];
    if (cut[k] || !(dt > 1e-6)) continue;
    for (let axis = 0; axis < 3; axis++) out[frame + axis] = (values[frame + axis] - values[frame - 3 + axis]) / dt;
  }
  return out;
}

function lengths(values) {
  return Float64Array.from({ length: values.length / 3 }, (_, k) =>
    Math.hypot(values[3 * k], values[3 * k + 1], values[3 * k + 2]),
  );
}

// Radians a second between one rotation and the next.
function turnRates(session) {
  const { camera, time_s, cut, frames } = session;
  return Float64Array.from({ length: frames }, (_, k) => {
    const dt = k > 0 ? time_s[k] - time_s[k - 1] : 0;
    if (!(dt > 1e-6) || cut[k]) return NaN;
    let dot = 0;
    for (let i = 3; i < 7; i++) dot += camera[7 * k + i] * camera[7 * k - 7 + i];
    return (2 * Math.acos(Math.min(1, Math.abs(dot)))) / dt;
  });
}

// The height of the largest target in the picture, as a share of the picture's height.
function shotSizes(session) {
  const { targets, distance_m, present, fov_rad, frames } = session;
  return Float64Array.from({ length: frames }, (_, frame) => {
    let most = NaN;
    targets.forEach(({ radius_m }, k) => {
      const away_m = distance_m[frame * targets.length + k];
      if (!((present[frame] >>> k) & 1) || !(radius_m > 0) || !(away_m > radius_m)) return;
      const size = radius_m / (away_m * Math.tan(fov_rad[frame] / 2));
      if (!(size <= most)) most = size;
    });
    return most;
  });
}

export function motionOf(session) {
  const positions = new Float64Array(3 * session.frames);
  for (let k = 0; k < session.frames; k++)
    for (let axis = 0; axis < 3; axis++) positions[3 * k + axis] = session.camera[7 * k + axis];
  const velocity = differences(positions, session.time_s, session.cut);
  const jerk = differences(differences(velocity, session.time_s, session.cut), session.time_s, session.cut);
  return {
    speed_mps: lengths(velocity),
    turn_radps: turnRates(session),
    jerk_mps3: lengths(jerk),
    shot_share: shotSizes(session),
  };
}
