// Reads what client/page/session_page.cpp wrote: names as they are, numbers as typed arrays, a row a frame.

const KINDS = {
  f64: Float64Array,
  f32: Float32Array,
  u32: Uint32Array,
  i32: Int32Array,
  u16: Uint16Array,
  u8: Uint8Array,
};

async function inflate(base64) {
  const text = atob(base64),
    bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Response(stream).arrayBuffer();
}

export async function readSession(page) {
  const session = JSON.parse(page.getElementById('session').textContent);
  const buffer = await inflate(page.getElementById('data').textContent.trim());
  for (const [name, [kind, offset, count]] of Object.entries(session.arrays))
    session[name] = new KINDS[kind](buffer, offset, count);
  session.frames = session.time_s.length;
  session.start_s = session.time_s[0];
  session.end_s = session.time_s[session.frames - 1];
  session.instancesOf = new Map();
  session.instances.forEach(({ id }, index) => {
    if (!session.instancesOf.has(id)) session.instancesOf.set(id, []);
    session.instancesOf.get(id).push(index);
  });
  return session;
}

// Positions as floats and plain indices of one mesh.
export function meshOf(session, index) {
  const { first_vertex, vertices, first_index, indices, low, step } = session.meshes[index];
  const positions = new Float32Array(3 * vertices);
  for (let i = 0; i < positions.length; i++)
    positions[i] = low[i % 3] + session.mesh_positions[3 * first_vertex + i] * step[i % 3];
  const plain = new Uint32Array(indices);
  let last = 0;
  for (let i = 0; i < indices; i++) plain[i] = last += session.mesh_indices[first_index + i];
  return { positions, indices: plain };
}

// The last frame at or before a time; the first one before all.
export function frameAt(session, time_s) {
  let low = 0,
    high = session.frames - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (session.time_s[middle] <= time_s) low = middle;
    else high = middle - 1;
  }
  return low;
}

// True when an instance exists in a frame.
export function lives(session, index, frame) {
  const { life } = session.instances[index];
  return !life || (frame >= life[0] && frame < life[1]);
}

// The instance of an id that is there in a frame; undefined: none is.
export function instanceAt(session, id, frame) {
  return session.instancesOf.get(id)?.find((index) => lives(session, index, frame));
}

// The index of the target that an instance is; -1: none.
export function targetOf(session, index) {
  return session.targets.findIndex(({ id }) => id === session.instances[index].id);
}

// One target in one frame. Placed: it is known where it is.
export function sightAt(session, frame, target) {
  const at = frame * session.targets.length + target;
  const aim = session.aim_m.subarray(3 * at, 3 * at + 3);
  const present = ((session.present[frame] >>> target) & 1) === 1;
  return {
    aim,
    present,
    placed: present && aim.every(Number.isFinite),
    visible: session.visible_share[at],
    filtered: session.filtered_share[at],
    truth: session.true_share[at],
    state: session.words[session.state[at]],
    distance: session.distance_m[at],
    occluder: session.occluder[at] < 0 ? null : session.occluders[session.occluder[at]],
    occluderShare: session.occluder_share[at],
  };
}

export function occluderName(session, id) {
  const [index] = session.instancesOf.get(id) || [];
  return (index !== undefined && session.instances[index].name) || `instance ${id}`;
}

const TERMS = ['side', 'height', 'distance'];
const COURSES = ['FOLLOW', 'STAY', 'PLAN'];

// The shot in force at a frame, and what was weighed against it; null: none was.
export function shotAt(session, frame) {
  if (!Number.isFinite(session.worth[frame])) return null;
  const name = (index) => (index < 0 ? null : occluderName(session, session.occluders[index]));
  return {
    place: session.shot_place_m.subarray(3 * frame, 3 * frame + 3),
    terms: TERMS.map((term, i) => ({
      term,
      asked: session.shot_asked[3 * frame + i],
      now: session.shot_now[3 * frame + i],
      off: session.shot_deviation[4 * frame + i],
    })),
    offPlace: session.shot_deviation[4 * frame + 3],
    sightLoss: session.sight_loss[frame],
    worth: session.worth[frame],
    hiddenBy: name(session.shot_hidden_by[frame]),
    hiddenTarget: name(session.shot_hidden_target[frame]),
    hiddenIn_s: session.shot_hidden_in_s[frame],
    course: session.words[session.course[frame]],
    losses: COURSES.map((course, i) => ({ course, loss: session.course_losses[3 * frame + i] })),
  };
}

// The sentence of a frame, with names in place of ids.
export function textAt(session, frame) {
  return session.words[session.text[frame]].replace(/\b(?:instance|target) (\d+)/g, (found, id) => {
    const [index] = session.instancesOf.get(id) || [];
    return (index !== undefined && session.instances[index].name) || found;
  });
}

// The kept cells at or before a frame, as a row of cell_frame; -1: none yet.
export function cellRowAt(session, frame) {
  let low = -1,
    high = session.cell_frame.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (session.cell_frame[middle] <= frame) low = middle;
    else high = middle - 1;
  }
  return low;
}

export function cellCount(session, row) {
  const end = row + 1 < session.cell_first.length ? session.cell_first[row + 1] : session.cell_mask.length;
  return end - session.cell_first[row];
}

// Calls visit(x, y, z, mask, isChosen) for each cell of a row.
export function eachCell(session, row, visit) {
  const first = session.cell_first[row];
  for (let i = first; i < first + cellCount(session, row); i++) {
    const at = (axis) => {
      const low = session.cell_low[3 * row + axis];
      return low + (session.cell_position[3 * i + axis] / 65535) * (session.cell_high[3 * row + axis] - low);
    };
    visit(at(0), at(1), at(2), session.cell_mask[i], i - first === session.cell_chosen[row]);
  }
}

// One word for a state and its colour.
export const LOOKS = ['seen', 'part', 'hidden', 'off'];
export function look(state) {
  return { VISIBLE: 'seen', PARTIAL: 'part', OCCLUDED: 'hidden' }[state] || 'off';
}
const ORDER = ['seen', 'part', 'off', 'hidden'];

export function worstLook(session, frame) {
  let worst = 0;
  for (let k = 0; k < session.targets.length; k++) {
    const { present, state } = sightAt(session, frame, k);
    if (present) worst = Math.max(worst, ORDER.indexOf(look(state)));
  }
  return ORDER[worst];
}

export function stageTotalUs(session, frame) {
  let total = 0;
  for (let i = 0; i < session.stages.length; i++) total += session.stage_us[frame * session.stages.length + i];
  return total;
}

export function flagNames(session, frame) {
  return session.flag_names.filter((_, i) => (session.flags[frame] >>> i) & 1);
}

// The picture at or before a frame; -1: none.
export function pictureAt(session, frame) {
  let found = -1;
  session.pictures.forEach((picture, i) => {
    if (picture.frame <= frame) found = i;
  });
  return found;
}

// Frames at which something changed or happened: status, reason, a cut, a mark.
export function eventFrames(session) {
  const marked = new Set(session.marks.map(({ frame }) => frame));
  const events = [];
  for (let i = 1; i < session.frames; i++)
    if (
      session.cut[i] ||
      session.status[i] !== session.status[i - 1] ||
      session.reason[i] !== session.reason[i - 1] ||
      marked.has(i)
    )
      events.push(i);
  return events;
}

// The events at frames [first, end).
export function marksAt(session, first, end = first + 1) {
  return session.marks.filter(({ frame }) => frame >= first && frame < end);
}

const TROUBLES = ['fault', 'rejection', 'gap'];
export function isTrouble(mark) {
  return TROUBLES.includes(mark.kind);
}
