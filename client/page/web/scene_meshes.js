// The meshes of the scene: static instances as instanced meshes, movers and targets as meshes of their own.
import * as THREE from 'three';
import { colour, targetColour } from './dom.js';
import { instanceAt, lives, meshOf, sightAt, targetOf } from './session.js';

const ROOF_M = 8; // a higher ceiling is not in the way

export class SceneMeshes {
  constructor(session) {
    this.session = session;
    this.group = new THREE.Group();
    this.cutPlane = new THREE.Plane(new THREE.Vector3(0, -1, 0), 0);
    this.geometries = session.meshes.map((_, i) => this.geometry(i));
    this.still = new THREE.MeshLambertMaterial({ flatShading: true, side: THREE.DoubleSide });
    this.moving = new THREE.MeshLambertMaterial({ flatShading: true, side: THREE.DoubleSide });
    this.addStill();
    this.addMovers();
    this.blockers = this.addBlockers();
    this.recolour();
  }

  geometry(index) {
    const { positions, indices } = meshOf(this.session, index);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
    geometry.setIndex(new THREE.BufferAttribute(indices, 1));
    return geometry;
  }

  // The matrix of an instance as it stands, columns x, y, z and origin.
  matrixOf(index) {
    const column = (i, w) => [...this.session.instance_transforms.subarray(12 * index + 3 * i, 12 * index + 3 * i + 3), w];
    return new THREE.Matrix4().fromArray([0, 1, 2, 3].flatMap((i) => column(i, i === 3 ? 1 : 0)));
  }

  addStill() {
    this.targetMaterials = this.session.targets.map(
      (_, k) => new THREE.MeshLambertMaterial({ flatShading: true, side: THREE.DoubleSide, color: targetColour(k) }),
    );
    const moving = new Set(this.session.movers.map(({ instance }) => instance));
    const byMesh = new Map();
    this.passing = []; // what stands still, but not in all frames
    this.stillTargets = [];
    this.session.instances.forEach((instance, index) => {
      if (moving.has(index)) return;
      if (targetOf(this.session, index) >= 0) return this.addStillTarget(index);
      const key = `${instance.mesh} ${instance.moves ? 'rests' : 'stands'}`;
      if (!byMesh.has(key)) byMesh.set(key, []);
      byMesh.get(key).push(index);
    });
    this.stillMeshes = [...byMesh.values()].map((indices) => {
      const { mesh, moves } = this.session.instances[indices[0]];
      const drawn = new THREE.InstancedMesh(this.geometries[mesh], moves ? this.moving : this.still, indices.length);
      indices.forEach((index, i) => {
        drawn.setMatrixAt(i, this.matrixOf(index));
        if (this.session.instances[index].life) this.passing.push({ drawn, i, index, shown: true });
      });
      this.group.add(drawn);
      return drawn;
    });
  }

  addStillTarget(index) {
    const drawn = new THREE.Mesh(
      this.geometries[this.session.instances[index].mesh],
      this.targetMaterials[targetOf(this.session, index)],
    );
    drawn.matrixAutoUpdate = false;
    drawn.matrix.copy(this.matrixOf(index));
    this.group.add(drawn);
    this.stillTargets.push({ drawn, index });
  }

  addMovers() {
    this.linear = this.session.movers.map(({ instance }) => this.matrixOf(instance));
    this.movers = this.session.movers.map(({ instance }) => {
      const k = targetOf(this.session, instance);
      const drawn = new THREE.Mesh(
        this.geometries[this.session.instances[instance].mesh],
        k < 0 ? this.moving : this.targetMaterials[k],
      );
      drawn.matrixAutoUpdate = false;
      this.group.add(drawn);
      return drawn;
    });
    this.moverOf = new Map(this.session.movers.map(({ instance }, i) => [instance, i]));
  }

  // One highlight a target: what hides it is drawn again, through everything.
  addBlockers() {
    this.blockerMaterial = new THREE.MeshBasicMaterial({
      transparent: true,
      opacity: 0.38,
      depthTest: false,
      side: THREE.DoubleSide,
    });
    return this.session.targets.map(() => {
      const drawn = new THREE.Mesh(new THREE.BufferGeometry(), this.blockerMaterial);
      drawn.matrixAutoUpdate = false;
      drawn.visible = false;
      drawn.renderOrder = 5;
      this.group.add(drawn);
      return drawn;
    });
  }

  recolour() {
    this.still.color.set(colour('stone'));
    this.moving.color.set(colour('mover'));
    this.blockerMaterial.color.set(colour('hidden'));
  }

  setXray(on) {
    Object.assign(this.still, { transparent: on, opacity: on ? 0.22 : 1, depthWrite: !on });
  }

  // Cuts away what is above a height; null: nothing.
  setCut(height_m) {
    this.still.clippingPlanes = height_m === null ? null : [this.cutPlane];
    if (height_m !== null) this.cutPlane.constant = height_m;
  }

  // How far apart any two things of the scene may be at the start, metres.
  size() {
    const box = new THREE.Box3().setFromObject(this.group),
      camera = this.session.camera;
    for (let frame = 0; frame < this.session.frames; frame++)
      box.expandByPoint(new THREE.Vector3().fromArray(camera, 7 * frame));
    return Math.max(100, 1.5 * box.getSize(new THREE.Vector3()).length());
  }

  // True when no still instance lies between two points.
  isOpen(a, b) {
    this.group.updateMatrixWorld(true);
    const way = b.clone().sub(a),
      ray = new THREE.Raycaster(a, way.clone().normalize(), 0, way.length());
    return ray.intersectObjects(this.stillMeshes, false).length === 0;
  }

  // True when the first target starts under a roof.
  hasRoof() {
    if (!this.session.targets.length) return false;
    const sight = sightAt(this.session, 0, 0);
    if (!sight.placed) return false;
    const from = new THREE.Vector3(...sight.aim);
    return !this.isOpen(from, from.clone().add(new THREE.Vector3(0, ROOF_M, 0)));
  }

  show(frame) {
    const { session } = this;
    this.showPassing(frame);
    const position = new THREE.Vector3(),
      rotation = new THREE.Quaternion(),
      one = new THREE.Vector3(1, 1, 1);
    this.movers.forEach((drawn, i) => {
      const { instance, first_pose } = session.movers[i];
      drawn.visible = lives(session, instance, frame);
      if (!drawn.visible) return;
      const at = 7 * (first_pose + frame - (session.instances[instance].life?.[0] ?? 0));
      const p = session.mover_poses.subarray(at, at + 7);
      drawn.matrix
        .compose(position.set(p[0], p[1], p[2]), rotation.set(p[3], p[4], p[5], p[6]), one)
        .multiply(this.linear[i]);
      drawn.matrixWorldNeedsUpdate = true;
    });
  }

  // Still instances with a limited life: a zero matrix hides one of an instanced mesh.
  showPassing(frame) {
    for (const { drawn, index } of this.stillTargets) drawn.visible = lives(this.session, index, frame);
    for (const each of this.passing) {
      const shown = lives(this.session, each.index, frame);
      if (shown === each.shown) continue;
      each.shown = shown;
      each.drawn.setMatrixAt(each.i, shown ? this.matrixOf(each.index) : new THREE.Matrix4().makeScale(0, 0, 0));
      each.drawn.instanceMatrix.needsUpdate = true;
    }
  }

  // Ids of what is drawn now, as the drawing has it.
  drawnIds() {
    const id = (index) => this.session.instances[index].id;
    const still = this.session.instances.map((_, index) => index).filter((index) => !this.moverOf.has(index));
    const gone = new Set(this.passing.filter((each) => !each.shown).map((each) => each.index));
    for (const { drawn, index } of this.stillTargets) if (!drawn.visible) gone.add(index);
    return [
      ...still.filter((index) => !gone.has(index)).map(id),
      ...this.session.movers.filter((_, i) => this.movers[i].visible).map(({ instance }) => id(instance)),
    ];
  }

  // Highlights the instance that hides target `k`, or nothing. Returns its mesh to be met by a ray, or null.
  showBlocker(k, id, frame) {
    const drawn = this.blockers[k];
    const index = id === null ? undefined : instanceAt(this.session, id, frame);
    drawn.visible = index !== undefined;
    if (index === undefined) return null;
    drawn.geometry = this.geometries[this.session.instances[index].mesh];
    const mover = this.moverOf.get(index);
    drawn.matrix.copy(mover === undefined ? this.matrixOf(index) : this.movers[mover].matrix);
    drawn.updateMatrixWorld(true);
    return drawn;
  }
}
