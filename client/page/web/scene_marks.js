// Draws the data of a step into the scene: paths, the camera and its frustum, candidate cells, sight lines.
import * as THREE from 'three';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { colour, targetColour } from './dom.js';
import { LOOKS, cellCount, cellRowAt, eachCell, frameAt, look, shotAt, sightAt, worstLook } from './session.js';

// In sessions longer than twice this, paths reach this far before and after the shown frame. Whole paths would cover the
// scene.
const PATH_S = 60;

function fatLines(width, options = {}) {
  return new LineSegments2(
    new LineSegmentsGeometry(),
    new LineMaterial({ linewidth: width, vertexColors: true, ...options }),
  );
}

function setLines(lines, positions, colours) {
  lines.visible = positions.length > 0;
  if (!positions.length) return;
  lines.geometry.dispose();
  lines.geometry = new LineSegmentsGeometry();
  lines.geometry.setPositions(positions);
  lines.geometry.setColors(colours);
}

export class SceneMarks {
  constructor(session) {
    this.session = session;
    this.group = new THREE.Group();
    this.paths = new THREE.Group();
    this.cells = this.makeCells();
    this.sight = new THREE.Group();
    this.rig = this.makeRig();
    this.shot = this.makeShot();
    this.lines = fatLines(2);
    this.hidden = fatLines(2, {
      dashed: true,
      dashSize: 0.12,
      gapSize: 0.1,
      depthTest: false,
      transparent: true,
      opacity: 0.8,
    });
    const ball = new THREE.SphereGeometry(0.07, 12, 8);
    this.hits = session.targets.map(() => new THREE.Mesh(ball, new THREE.MeshBasicMaterial({ depthTest: false })));
    for (const hit of this.hits) hit.renderOrder = 7;
    this.sight.add(this.lines, this.hidden, ...this.hits);
    this.group.add(this.paths, this.cells, this.chosen, this.sight, this.rig, this.shot);
    this.recolour();
  }

  // ---- paths: the camera's in the colour of the worst target at the time, each target's in its own ----

  showPaths(frame) {
    const { session } = this,
      now_s = session.time_s[frame];
    const whole = session.end_s - session.start_s <= 2 * PATH_S;
    if (this.pathsOf_s !== null && (whole || Math.abs(now_s - this.pathsOf_s) < PATH_S / 6)) return;
    this.pathsOf_s = now_s;
    this.pathFrames = whole
      ? [0, session.frames - 1]
      : [frameAt(session, now_s - PATH_S), frameAt(session, now_s + PATH_S)];
    this.makePaths();
  }

  makePaths() {
    for (const lines of this.paths.children) (lines.geometry.dispose(), lines.material.dispose());
    this.paths.clear();
    const { session } = this,
      count = session.targets.length;
    const place = (frame) => session.camera.subarray(7 * frame, 7 * frame + 3);
    this.paths.add(
      this.pathOf(
        place,
        (frame) => this.colours[worstLook(session, frame)],
        2.5,
        (frame) => !session.cut[frame],
      ),
    );
    for (let k = 0; k < count; k++) {
      const own = new THREE.Color(targetColour(k));
      this.paths.add(
        this.pathOf(
          (frame) => sightAt(session, frame, k).aim,
          () => own,
          1,
          (frame) => sightAt(session, frame - 1, k).placed && sightAt(session, frame, k).placed,
        ),
      );
    }
  }

  pathOf(place, paint, width, joins) {
    const positions = [],
      colours = [];
    const [first, last] = this.pathFrames;
    for (let frame = first + 1; frame <= last; frame++) {
      if (!joins(frame)) continue;
      const { r, g, b } = paint(frame);
      positions.push(...place(frame - 1), ...place(frame));
      colours.push(r, g, b, r, g, b);
    }
    const lines = fatLines(width);
    setLines(lines, positions, colours);
    return lines;
  }

  // ---- the camera: its body and what its lens takes in ----

  makeRig() {
    const rig = new THREE.Group();
    this.rigMaterial = new THREE.LineBasicMaterial();
    const corners = [
        [-1, -1],
        [1, -1],
        [1, 1],
        [-1, 1],
      ],
      points = [];
    corners.forEach((corner, i) => {
      const next = corners[(i + 1) % 4];
      points.push(0, 0, 0, ...corner, -1, ...corner, -1, ...next, -1);
    });
    points.push(-0.3, 1.08, -1, 0.3, 1.08, -1, 0.3, 1.08, -1, 0, 1.35, -1, 0, 1.35, -1, -0.3, 1.08, -1); // up
    this.frustum = new THREE.LineSegments(
      new THREE.BufferGeometry().setAttribute('position', new THREE.Float32BufferAttribute(points, 3)),
      this.rigMaterial,
    );
    const radius = Math.max(0.05, this.session.body_radius_m);
    this.bodyMaterial = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.4 });
    rig.add(this.frustum, new THREE.Mesh(new THREE.IcosahedronGeometry(radius, 2), this.bodyMaterial));
    return rig;
  }

  showRig(frame, reach_m) {
    const c = this.session.camera.subarray(7 * frame, 7 * frame + 7);
    this.rig.position.set(c[0], c[1], c[2]);
    this.rig.quaternion.set(c[3], c[4], c[5], c[6]);
    const high = reach_m * Math.tan(this.session.fov_rad[frame] / 2);
    this.frustum.scale.set(high * this.session.aspect, high, reach_m);
  }

  // ---- the shot that was asked for: a camera at its place, and the way there ----

  makeShot() {
    this.shotMaterial = new THREE.LineDashedMaterial({ dashSize: 0.25, gapSize: 0.15 });
    this.asked = new THREE.LineSegments(this.frustum.geometry, this.shotMaterial);
    this.wayToShot = new THREE.Line(
      new THREE.BufferGeometry().setAttribute('position', new THREE.Float32BufferAttribute(6, 3)),
      this.shotMaterial,
    );
    this.wayToShot.frustumCulled = false;
    this.asked.computeLineDistances();
    return new THREE.Group().add(this.asked, this.wayToShot);
  }

  // It looks at `middle`, with the lens of the frame.
  showShot(frame, on, middle, reach_m) {
    const shot = on ? shotAt(this.session, frame) : null;
    this.shot.visible = shot !== null;
    if (!shot) return;
    this.asked.position.set(...shot.place);
    this.asked.lookAt(this.asked.position.clone().multiplyScalar(2).sub(middle)); // an object looks along +Z, a camera along -Z
    this.asked.scale.copy(this.frustum.scale).multiplyScalar(reach_m / this.frustum.scale.z);
    const ends = this.wayToShot.geometry.getAttribute('position');
    ends.setXYZ(0, ...this.session.camera.subarray(7 * frame, 7 * frame + 3));
    ends.setXYZ(1, ...shot.place);
    ends.needsUpdate = true;
    this.wayToShot.computeLineDistances();
  }

  // ---- cells ----

  makeCells() {
    let most = 1;
    for (let row = 0; row < this.session.cell_first.length; row++) most = Math.max(most, cellCount(this.session, row));
    const material = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.6 });
    const cells = new THREE.InstancedMesh(new THREE.BoxGeometry(1, 1, 1), material, most);
    cells.frustumCulled = false;
    this.chosen = new THREE.LineSegments(
      new THREE.EdgesGeometry(new THREE.BoxGeometry(1, 1, 1)),
      new THREE.LineBasicMaterial(),
    );
    return cells;
  }

  showCells(frame, on) {
    const { session, cells } = this,
      row = on ? cellRowAt(session, frame) : -1;
    cells.count = 0;
    cells.visible = row >= 0;
    this.chosen.visible = false;
    if (row < 0 || row === this.cellRow) return this.keepCells(row);
    this.cellRow = row;
    const steered = session.steered[session.cell_frame[row]];
    const edge = this.cellEdge(row),
      matrix = new THREE.Matrix4();
    let i = 0;
    eachCell(session, row, (x, y, z, mask, isChosen) => {
      const name = this.cellLook(mask, steered),
        size = edge * { seen: 0.15, part: 0.15, hidden: 0.1 }[name];
      cells.setMatrixAt(i, matrix.makeScale(size, size, size).setPosition(x, y, z));
      cells.setColorAt(i++, this.colours[name]);
      if (!isChosen) return;
      this.chosen.visible = true;
      this.chosen.position.set(x, y, z);
      this.chosen.scale.setScalar(0.6 * edge);
    });
    this.kept = { count: i, chosen: this.chosen.visible };
    cells.count = i;
    cells.instanceMatrix.needsUpdate = true;
    cells.instanceColor.needsUpdate = true;
  }

  keepCells(row) {
    if (row < 0 || !this.kept) return;
    this.cells.count = this.kept.count;
    this.chosen.visible = this.kept.chosen;
  }

  // Coloured as the step counted them: by the targets that it steered for.
  cellLook(mask, steered) {
    const seen = (mask & steered) >>> 0;
    return seen === steered ? 'seen' : seen ? 'part' : 'hidden';
  }

  // The distance between neighbouring cells, from their number and the ball that they fill.
  cellEdge(row) {
    const { session } = this;
    let volume_m3 = Math.PI / 6;
    for (let i = 3 * row; i < 3 * row + 3; i++) volume_m3 *= Math.max(0.1, session.cell_high[i] - session.cell_low[i]);
    return Math.cbrt(volume_m3 / Math.max(1, cellCount(session, row)));
  }

  // ---- sight lines ----

  // `meets(k, from, to)` gives where the blocker of target k is met on the way, or null.
  showSight(frame, meets) {
    const { session } = this,
      open = [[], []],
      shut = [[], []];
    const from = new THREE.Vector3(...session.camera.subarray(7 * frame, 7 * frame + 3)),
      to = new THREE.Vector3();
    session.targets.forEach((_, k) => {
      const sight = sightAt(session, frame, k),
        name = look(sight.state);
      const hit = meets(k, from, to.set(...sight.aim));
      this.hits[k].visible = false;
      if (!sight.placed) return;
      this.hits[k].visible = hit !== null;
      if (hit) this.hits[k].position.copy(hit);
      // The part behind what blocks it, or the whole of one that is out of sight, is dashed.
      if (name === 'off') this.addLine(shut, from, to, name);
      else if (hit) (this.addLine(open, from, hit, name), this.addLine(shut, hit, to, 'hidden'));
      else this.addLine(name === 'hidden' ? shut : open, from, to, name);
    });
    setLines(this.lines, ...open);
    setLines(this.hidden, ...shut);
    if (shut[0].length) this.hidden.computeLineDistances();
  }

  addLine([positions, colours], a, b, name) {
    const { r, g, b: blue } = this.colours[name];
    positions.push(a.x, a.y, a.z, b.x, b.y, b.z);
    colours.push(r, g, blue, r, g, blue);
  }

  recolour() {
    this.colours = Object.fromEntries(LOOKS.map((name) => [name, new THREE.Color(colour(name))]));
    this.rigMaterial.color.set(colour('accent'));
    this.bodyMaterial.color.set(colour('accent'));
    this.shotMaterial.color.set(colour('text'));
    this.chosen.material.color.set(colour('text'));
    for (const hit of this.hits) hit.material.color.set(colour('hidden'));
    this.cellRow = undefined;
    this.pathsOf_s = null;
  }
}
