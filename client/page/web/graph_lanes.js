// Lanes that draw one number a frame as a line: how the camera moved, and how close it was.
import { colour, fixed } from './dom.js';
import { motionOf } from './motion.js';

const HEIGHT = 17;

// `worst`: which value of the frames that share a column of pixels is drawn.
function graph(session, label, values, unit, digits, worst) {
  const known = Array.from(values).filter(Number.isFinite);
  if (!known.length) return null;
  known.sort((a, b) => a - b);
  // The scale ends above the value that 99 % of the frames stay below, so that one peak does not flatten the rest.
  const most = Math.max(1e-6, Math.min(known.at(-1), 1.33 * known[Math.floor(0.99 * (known.length - 1))]));
  return {
    label,
    height: HEIGHT,
    value: (frame) => (Number.isFinite(values[frame]) ? `${fixed(values[frame], digits)} ${unit}`.trim() : ''),
    draw(context, line, top, right) {
      const yOf = (value) => top + HEIGHT - 3 - Math.min(1, value / most) * (HEIGHT - 6);
      context.fillStyle = colour('line');
      context.fillRect(line.xOf(line.from_s), top + HEIGHT - 2, right, 1);
      context.strokeStyle = colour('accent');
      context.lineWidth = 1.2;
      context.beginPath();
      let joined = false;
      line.eachColumn((x, _, first, end) => {
        let drawn = NaN;
        for (let frame = first; frame < end; frame++)
          if (Number.isFinite(values[frame])) drawn = Number.isNaN(drawn) ? values[frame] : worst(drawn, values[frame]);
        if (Number.isNaN(drawn)) return (joined = false);
        if (joined) context.lineTo(x, yOf(drawn));
        else context.moveTo(x, yOf(drawn));
        joined = true;
      });
      context.stroke();
    },
  };
}

export function makeGraphLanes(session) {
  const motion = motionOf(session);
  return [
    graph(session, 'Worth', session.worth, '', 2, Math.min),
    graph(session, 'Speed', motion.speed_mps, 'm/s', 1, Math.max),
    graph(session, 'Turn', motion.turn_radps, 'rad/s', 2, Math.max),
    graph(session, 'Jerk', motion.jerk_mps3, 'm/s³', 0, Math.max),
    graph(session, 'Clearance', session.clearance_m, 'm', 2, Math.min),
    graph(session, 'Shot size', motion.shot_share, 'h', 2, Math.max),
  ].filter(Boolean);
}
