import {Camera, box, capsule, instance, transforms, vector} from "sightline-client";

const [ANNA, BEN, PILLAR] = [1n, 2n, 3n];
const person = capsule(0.3, 1.8);

function positions(timeS) {  // where Anna and Ben are, in metres; +Y is up
  const x = 3 * Math.sin(timeS);
  return [[ANNA, [x - 0.6, 0.9, 0]], [BEN, [x + 0.6, 0.9, 0]]];
}

const camera = await Camera.open(process.argv[2] ?? "127.0.0.1:50151", {
  instances: [...positions(0).map(([id, position]) => instance(id, person, position)), instance(PILLAR, box(1, 4, 1), [0, 2, 2])],
  targets: [{id: ANNA}, {id: BEN}],
  camera: {position: vector([0, 1.6, 6])},
});
for (let frame = 0; frame < 300; frame++) {
  const reply = await camera.tick({timeS: frame / 60, transforms: transforms(positions(frame / 60))});
  const {x, y, z} = reply.pose.position;
  const seen = reply.targets.map((target) => `${Math.round(100 * target.visibleShare)}%`);
  console.log(`${reply.timeS.toFixed(2)} s  camera (${[x, y, z].map((value) => value.toFixed(2)).join(", ")})  visible ${seen.join(" ")}`);
}
await camera.close();
