// The 3D view: the session from outside or through its camera, the other of the two as an inset.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { colour } from './dom.js';
import { SceneMarks } from './scene_marks.js';
import { SceneMeshes } from './scene_meshes.js';
import { sightAt } from './session.js';

const INSET_SHARE = 0.28,
  PICK_PIXELS = 14,
  ABOVE_TARGETS_M = 1.1;
const UP = new THREE.Vector3(0, 1, 0);
// First viewpoints to try, in this order. The angle is in radians about the line from the targets to the camera.
// Distance and height are in units of the length of that line.
const SIDES = [
  [0.65, 1.55, 0.95],
  [-0.65, 1.55, 0.95],
  [1.3, 1.4, 0.95],
  [-1.3, 1.4, 0.95],
  [0.65, 1.1, 1.9],
  [-0.65, 1.1, 1.9],
  [2.4, 1.4, 1.2],
  [-2.4, 1.4, 1.2],
  [0.3, 0.5, 2.6],
  [2.8, 0.5, 2.6],
];

export class SceneView {
  constructor(session, player, section) {
    Object.assign(this, { session, player, section });
    this.canvas = section.querySelector('#scene');
    this.inset = section.querySelector('#inset');
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true });
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.renderer.localClippingEnabled = true;
    this.renderer.autoClear = false;
    this.scene = new THREE.Scene();
    this.meshes = new SceneMeshes(session);
    this.marks = new SceneMarks(session);
    this.light = new THREE.DirectionalLight(0xffffff, 1.9);
    this.light.position.set(0.4, 0.8, 0.45);
    this.scene.add(this.meshes.group, this.marks.group, new THREE.HemisphereLight(0xffffff, 0x8a8f99, 1.5), this.light);
    this.lens = new THREE.PerspectiveCamera();
    this.outside = new THREE.PerspectiveCamera(45);
    this.through = false;
    this.shows = { follow: true, cut: this.meshes.hasRoof(), xray: false, cells: true, sight: true, path: true, shot: true };
    this.size_m = this.meshes.size();
    this.placeOutside();
    this.listen();
    this.recolour();
    this.show();
  }

  // ---- the outside viewpoint ----

  place(frame = this.player.frame) {
    return new THREE.Vector3().fromArray(this.session.camera, 7 * frame);
  }

  // The middle of the targets; the camera's position when there are none, or their positions are unknown.
  middle(frame = this.player.frame) {
    const { session } = this,
      sum = new THREE.Vector3();
    const placed = session.targets.map((_, k) => sightAt(session, frame, k)).filter((sight) => sight.placed);
    if (!placed.length) return this.place(frame);
    for (const { aim } of placed) sum.add(new THREE.Vector3(...aim));
    return sum.divideScalar(placed.length);
  }

  // The outside view turns around this point between targets and camera.
  focus() {
    return this.middle().lerp(this.place(), 0.4);
  }

  // From above and behind the camera's shoulder, or from the first side from which targets and camera can be seen.
  placeOutside() {
    const focus = this.focus(),
      back = this.place().sub(this.middle());
    const reach = Math.max(3, back.length());
    back.setY(0);
    if (back.length() < 1e-3) back.set(0, 0, 1);
    back.normalize();
    const places = SIDES.map(([yaw, away, up]) =>
      back
        .clone()
        .applyAxisAngle(UP, yaw)
        .multiplyScalar(away * reach)
        .add(new THREE.Vector3(0, up * reach, 0))
        .add(focus),
    );
    const open = places.find(
      (place) => this.meshes.isOpen(place, this.middle()) && this.meshes.isOpen(place, this.place()),
    );
    this.outside.position.copy(open || places[0]);
    this.stepBack(focus);
    this.controls = new OrbitControls(this.outside, this.canvas);
    this.controls.target.copy(focus);
    this.controls.zoomToCursor = true;
    this.controls.maxDistance = 2000;
    this.controls.update();
    this.controls.addEventListener('change', () => this.render());
    this.followed = focus;
  }

  // Moves the outside viewpoint away from what it looks at until the camera and every target are in the picture, with room for the
  // buttons above and the inset below.
  stepBack(focus) {
    const { session } = this,
      frame = this.player.frame;
    const { clientWidth: width, clientHeight: height } = this.section;
    const shown = session.targets
      .map((_, k) => sightAt(session, frame, k))
      .filter(({ placed }) => placed)
      .map(({ aim }) => new THREE.Vector3(...aim));
    shown.push(this.place(frame));
    this.outside.aspect = height > 0 ? width / height : session.aspect;
    this.outside.lookAt(focus);
    this.outside.updateProjectionMatrix();
    const inside = (point) => {
      this.outside.updateMatrixWorld();
      const at = point.clone().project(this.outside);
      return at.z < 1 && Math.abs(at.x) < 0.8 && Math.abs(at.y) < 0.7;
    };
    for (let tries = 0; tries < 20 && !shown.every(inside); tries++)
      this.outside.position.sub(focus).multiplyScalar(1.2).add(focus);
  }

  // Moves with the targets, keeping what the user has chosen.
  followTargets() {
    const focus = this.focus(),
      way = focus.clone().sub(this.followed);
    this.followed = focus;
    if (!this.shows.follow || way.lengthSq() === 0) return;
    this.outside.position.add(way);
    this.controls.target.add(way);
  }

  setThrough(on) {
    this.through = on;
    this.controls.enabled = !on;
    this.render();
  }

  set(name, on) {
    this.shows[name] = on;
    if (name === 'path') this.marks.paths.visible = on;
    this.show();
  }

  // ---- a frame ----

  show() {
    const { frame } = this.player,
      { session } = this;
    this.meshes.show(frame);
    this.followTargets();
    const away_m = session.targets
      .map((_, k) => sightAt(session, frame, k))
      .filter(({ present, distance }) => present && distance > 0)
      .map(({ distance }) => distance);
    const reach_m = 0.5 * Math.min(...away_m, 6);
    this.marks.showRig(frame, reach_m);
    this.marks.showShot(frame, this.shows.shot, this.middle(frame), 0.7 * reach_m);
    if (this.shows.path) this.marks.showPaths(frame);
    this.marks.showCells(frame, this.shows.cells);
    this.marks.sight.visible = this.shows.sight;
    this.marks.showSight(frame, (k, from, to) => this.meet(frame, k, from, to));
    this.cut_m = this.middle(frame).y + ABOVE_TARGETS_M;
    this.lens.position.fromArray(session.camera, 7 * frame);
    this.lens.quaternion.fromArray(session.camera, 7 * frame + 3);
    this.lens.fov = (session.fov_rad[frame] * 180) / Math.PI;
    this.lens.aspect = session.aspect;
    this.lens.near = 0.1;
    this.lens.far = this.size_m;
    this.lens.updateProjectionMatrix();
    this.render();
  }

  // The point at which the straight way to target k is blocked; null when only other points of it are hidden, or none
  // is.
  meet(frame, k, from, to) {
    const sight = sightAt(this.session, frame, k);
    const blocker = this.meshes.showBlocker(k, this.shows.sight && sight.placed ? sight.occluder : null, frame);
    if (!blocker) return null;
    const way = to.clone().sub(from);
    const ray = new THREE.Raycaster(from, way.clone().normalize(), 0, way.length());
    return ray.intersectObject(blocker, false)[0]?.point ?? null;
  }

  // ---- drawing, at most once a picture of the screen ----

  render() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.draw();
    });
  }

  // Rectangles are in pixels of the page, y from the bottom.
  rectangles() {
    const { clientWidth: width, clientHeight: height } = this.section,
      { aspect } = this.session;
    const all = { x: 0, y: 0, width, height };
    const fitted = Math.min(width, height * aspect);
    const picture = {
      x: (width - fitted) / 2,
      y: (height - fitted / aspect) / 2,
      width: fitted,
      height: fitted / aspect,
    };
    const small = Math.max(200, INSET_SHARE * width);
    const inset = { x: width - small - 10, y: 10, width: small, height: small / aspect };
    return { all, picture, inset };
  }

  draw() {
    const { all, picture, inset } = this.rectangles();
    if (!all.width || !all.height) return;
    this.renderer.setSize(all.width, all.height, false);
    this.renderer.setScissorTest(false);
    this.renderer.setClearColor(colour(this.through ? 'bg' : 'sky'));
    this.renderer.clear();
    this.drawInto(this.through ? picture : all, this.through);
    this.inset.style.width = `${inset.width}px`;
    this.inset.style.height = `${inset.height}px`;
    this.drawInto(inset, !this.through);
  }

  // Through its own lens the scene is complete, and the camera, its cells and its path are not drawn.
  drawInto({ x, y, width, height }, through) {
    const { marks, renderer } = this;
    renderer.setViewport(x, y, width, height);
    renderer.setScissor(x, y, width, height);
    renderer.setScissorTest(true);
    renderer.setClearColor(colour('sky'));
    renderer.clear();
    this.meshes.setXray(this.shows.xray && !through);
    this.meshes.setCut(this.shows.cut && !through ? this.cut_m : null);
    marks.group.visible = !through;
    // The near plane follows the distance of the viewer, so that depth keeps its resolution.
    const away_m = this.outside.position.distanceTo(this.controls.target);
    this.outside.near = Math.min(2, Math.max(0.02, 0.02 * away_m));
    this.outside.far = away_m + this.size_m;
    this.outside.aspect = width / height;
    this.outside.updateProjectionMatrix();
    renderer.render(this.scene, through ? this.lens : this.outside);
  }

  recolour() {
    this.meshes.recolour();
    this.marks.recolour();
    this.show();
  }

  // ---- the pointer ----

  listen() {
    new ResizeObserver(() => this.render()).observe(this.section);
    let down = null;
    this.canvas.addEventListener('pointerdown', (event) => {
      down = [event.clientX, event.clientY];
    });
    this.canvas.addEventListener('pointerup', (event) => {
      const moved = down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 3;
      if (!down || moved || event.button !== 0) return;
      const frame = this.frameNear(event);
      if (frame === null) return;
      this.player.pause();
      this.player.seek(frame);
    });
  }

  // The frame whose camera is nearest to the pointer in the picture.
  frameNear(event) {
    if (this.through || !this.shows.path) return null;
    const box = this.canvas.getBoundingClientRect(),
      point = new THREE.Vector3();
    let best = PICK_PIXELS,
      found = null;
    const [first, last] = this.marks.pathFrames;
    for (let frame = first; frame <= last; frame++) {
      point.fromArray(this.session.camera, 7 * frame).project(this.outside);
      if (point.z > 1) continue;
      const away = Math.hypot(
        ((point.x + 1) / 2) * box.width - (event.clientX - box.left),
        ((1 - point.y) / 2) * box.height - (event.clientY - box.top),
      );
      if (away < best) [best, found] = [away, frame];
    }
    return found;
  }

  // The state of the 3D cameras, for tests and the console.
  state() {
    const pose = ({ position, quaternion }) => ({ position: position.toArray(), rotation: quaternion.toArray() });
    return {
      through: this.through,
      lens: pose(this.lens),
      outside: pose(this.outside),
      cells: this.marks.cells.count,
      drawn: this.meshes.drawnIds(),
      blockers: this.meshes.blockers.filter((drawn) => drawn.visible).length,
    };
  }
}
