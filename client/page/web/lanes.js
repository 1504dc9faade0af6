// Draws the lanes of the time line. A column of pixels that many frames share shows the worst of them: a short loss of
// sight is never smoothed away.
import { colour, fixed, plain, targetColour } from './dom.js';
import { makeGraphLanes } from './graph_lanes.js';
import { isTrouble, look, sightAt, stageTotalUs } from './session.js';

// Room for the names, pixels.
export const GUTTER = 124;
const WORST_FIRST = ['hidden', 'off', 'part', 'seen'];

export function makeLanes(session) {
  const lanes = [ruler(session)];
  if (session.pictures.length) lanes.push(pictures(session));
  session.targets.forEach((target, k) => lanes.push(share(session, target, k)));
  lanes.push(words(session, 'status', 'Status'), words(session, 'reason', 'Reason'));
  if (session.marks.length) lanes.push(events(session));
  lanes.push(
    flags(session),
    ...makeGraphLanes(session),
    cells(session),
    stages(session),
  );
  return lanes;
}

function ruler(session) {
  const STEPS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600];
  return {
    label: 'Time, s',
    height: 22,
    draw(context, line, top, right) {
      const wanted = ((line.to_s - line.from_s) / (right - GUTTER)) * 80;
      const step = STEPS.find((s) => s >= wanted) || 1200;
      const digits = step < 0.1 ? 2 : step < 1 ? 1 : 0;
      for (let k = Math.ceil(line.from_s / step - 1e-9); k * step <= line.to_s + 1e-9; k++) {
        const x = Math.round(line.xOf(k * step));
        context.fillStyle = colour('line');
        context.fillRect(x, top + 15, 1, 7);
        context.fillStyle = colour('dim');
        context.textAlign = x > right - 20 ? 'right' : 'left';
        context.fillText(fixed(k * step, digits), x + (x > right - 20 ? -3 : 3), top + 11);
      }
      context.textAlign = 'left';
    },
  };
}

function pictures(session) {
  const height = 34;
  const images = session.pictures.map(({ url }) => Object.assign(new Image(), { src: url }));
  const lane = {
    label: 'Seen by the camera',
    height: height + 4,
    draw(context, line, top, right) {
      let free = 0;
      images.forEach((image, i) => {
        const width = height * session.aspect;
        const x = line.xOf(session.time_s[session.pictures[i].frame]);
        if (x < free || x > right - 8) return;
        if (image.complete) context.drawImage(image, x, top + 2, width, height);
        else image.onload = () => line.draw();
        context.fillStyle = colour('dim');
        context.fillRect(Math.round(x), top + 2, 1, height);
        free = x + width + 1;
      });
    },
  };
  return lane;
}

// One target. The visible share is a filled line in the colour of the state, the filtered share a line in the target's own
// colour, the truth dots.
function share(session, target, k) {
  const count = session.targets.length,
    height = count > 2 ? 24 : 30;
  return {
    label: target.name,
    height,
    labelHeight: height,
    value: (frame) => {
      const { present, visible } = sightAt(session, frame, k);
      return present ? `${fixed(100 * visible, 0)} %` : '';
    },
    draw(context, line, top, right) {
      const yOf = (value) => top + height - 4 - value * (height - 8);
      context.fillStyle = colour('line');
      context.fillRect(GUTTER, Math.round(yOf(0)), right - GUTTER, 1);
      const fill = Object.fromEntries(WORST_FIRST.map((name) => [name, colour(name)]));
      const dots = [];
      const filtered = [];
      line.eachColumn((x, width, first, end) => {
        let least = 1,
          leastFiltered = 1,
          worst = 3,
          truth = NaN,
          present = false;
        for (let frame = first; frame < end; frame++) {
          if (!((session.present[frame] >>> k) & 1)) continue;
          present = true;
          const at = frame * count + k;
          least = Math.min(least, session.visible_share[at]);
          leastFiltered = Math.min(leastFiltered, session.filtered_share[at]);
          worst = Math.min(worst, WORST_FIRST.indexOf(look(session.words[session.state[at]])));
          if (!(session.true_share[at] >= truth))
            truth = Number.isNaN(session.true_share[at]) ? truth : session.true_share[at];
        }
        // It is no target then: the line ends, and a new one begins later.
        if (!present) return filtered.push(null);
        context.globalAlpha = 0.5;
        context.fillStyle = fill[WORST_FIRST[worst]];
        // A target that is not seen at all still has its colour, as a stripe along the bottom.
        context.fillRect(x, yOf(least), width, Math.max(2, yOf(0) - yOf(least)));
        context.globalAlpha = 1;
        filtered.push([x, yOf(leastFiltered)]);
        if (!Number.isNaN(truth)) dots.push([x, yOf(truth)]);
      });
      context.strokeStyle = targetColour(k);
      context.lineWidth = 1.5;
      context.beginPath();
      filtered.forEach((point, i) => {
        if (point) filtered[i - 1] ? context.lineTo(...point) : context.moveTo(...point);
      });
      context.stroke();
      context.fillStyle = colour('text');
      let last = -9;
      for (const [x, y] of dots) {
        if (x - last < 4) continue;
        context.fillRect(x - 0.75, y - 0.75, 1.5, 1.5);
        last = x;
      }
    },
  };
}

const STATUS_COLOURS = {
  TRACKING: 'status-0',
  PARTIAL_VIEW: 'status-1',
  SEEKING: 'status-2',
  BLOCKED: 'status-2',
  WAITING: 'status-2',
  LOST: 'status-2',
  ESCAPING: 'status-2', // of recordings of earlier versions
};

// Bands of equal words, the word inside where there is room.
function words(session, column, label) {
  const height = 18;
  const runs = [];
  for (let frame = 0; frame < session.frames; frame++)
    if (!runs.length || session[column][frame] !== session[column][runs.at(-1)]) runs.push(frame);
  return {
    label,
    height,
    draw(context, line, top) {
      runs.forEach((first, i) => {
        const end = runs[i + 1];
        const x0 = Math.max(GUTTER, line.xOf(session.time_s[first]));
        const x1 = Math.min(line.width - 8, line.xOf(end === undefined ? session.end_s : session.time_s[end]));
        if (x1 < GUTTER || x0 > line.width) return;
        context.fillStyle = colour(STATUS_COLOURS[session.words[session.status[first]]] || 'status-3');
        context.fillRect(x0, top + 1, Math.max(1, x1 - x0 - 1), height - 2);
        const word = plain(session.words[session[column][first]]);
        if (context.measureText(word).width > x1 - x0 - 8) return;
        context.fillStyle = colour('text');
        context.fillText(word, x0 + 4, top + height / 2 + 0.5);
      });
    },
  };
}

// Events as diamonds. Trouble is drawn above notes, so that it is never covered.
function events(session) {
  const height = 16,
    half = 4;
  return {
    label: 'Events',
    height,
    draw(context, line, top) {
      for (const [trouble, name] of [
        [false, 'accent'],
        [true, 'hidden'],
      ]) {
        context.fillStyle = colour(name);
        let last = -Infinity;
        for (const mark of session.marks) {
          if (isTrouble(mark) !== trouble) continue;
          const x = line.xOf(session.time_s[mark.frame]),
            y = top + height / 2;
          if (x < GUTTER || x - last < 1) continue;
          last = x;
          context.beginPath();
          context.moveTo(x - half, y);
          context.lineTo(x, y - half);
          context.lineTo(x + half, y);
          context.lineTo(x, y + half);
          context.fill();
        }
      }
    },
  };
}

// Cuts as full marks; flags and merged ticks as small ones.
function flags(session) {
  const height = 16;
  return {
    label: 'Cuts, flags',
    height,
    draw(context, line, top) {
      line.eachColumn((x, width, first, end) => {
        let cut = false,
          flag = false;
        for (let frame = first; frame < end; frame++) {
          cut ||= session.cut[frame] !== 0;
          flag ||= session.flags[frame] !== 0 || session.merged[frame] !== 0;
        }
        context.fillStyle = colour(cut ? 'hidden' : 'part');
        if (flag) context.fillRect(x, top + height - 5, width, 3);
        if (!cut) return;
        context.fillRect(x - 0.5, top + 1, 2, height - 2);
        context.fillText('cut', x + 4, top + height / 2);
      });
    },
  };
}

function cells(session) {
  const height = 20;
  return {
    label: 'Cells',
    height,
    value: (frame) => String(session.counts[3 * frame] + session.counts[3 * frame + 1] + session.counts[3 * frame + 2]),
    draw(context, line, top) {
      const fill = ['seen', 'part', 'hidden'].map(colour);
      context.globalAlpha = 0.6;
      line.eachColumn((x, width, first, end) => {
        const sum = [0, 0, 0];
        for (let frame = first; frame < end; frame++)
          for (let i = 0; i < 3; i++) sum[i] += session.counts[3 * frame + i];
        const all = sum[0] + sum[1] + sum[2];
        let y = top + height - 2;
        for (let i = 0; i < 3 && all > 0; i++) {
          const part = (sum[i] / all) * (height - 4);
          context.fillStyle = fill[i];
          context.fillRect(x, y - part, width, part);
          y -= part;
        }
      });
      context.globalAlpha = 1;
    },
  };
}

// The longest step of each column, with its stages stacked. The scale ends a third above the value that 99 % of the
// steps stay below, so that one slow step does not flatten the others.
function stages(session) {
  const height = 40,
    count = session.stages.length;
  const totals = Float64Array.from({ length: session.frames }, (_, frame) => stageTotalUs(session, frame)).sort();
  const most = Math.max(1, Math.min(totals.at(-1), 1.33 * totals[Math.floor(0.99 * (totals.length - 1))]));
  return {
    label: 'Step, ms',
    height,
    labelHeight: height,
    value: (frame) => fixed(stageTotalUs(session, frame) / 1000, 2),
    draw(context, line, top, right) {
      const fill = session.stages.map((_, i) => colour(`stage-${i % 6}`));
      const scale = (height - 6) / most;
      line.eachColumn((x, width, first, end) => {
        let worst = first,
          total = -1;
        for (let frame = first; frame < end; frame++) {
          const now = stageTotalUs(session, frame);
          if (now > total) [worst, total] = [frame, now];
        }
        let y = top + height - 2;
        for (let i = 0; i < count; i++) {
          const part = session.stage_us[worst * count + i] * scale;
          context.fillStyle = fill[i];
          context.fillRect(x, y - part, width, part);
          y -= part;
        }
      });
      const scaleText = `${fixed(most / 1000, 2)} ms`;
      context.fillStyle = colour('panel');
      context.fillRect(right - context.measureText(scaleText).width - 8, top, 200, 15);
      context.fillStyle = colour('dim');
      context.textAlign = 'right';
      context.fillText(scaleText, right - 4, top + 8);
      context.textAlign = 'left';
    },
  };
}
