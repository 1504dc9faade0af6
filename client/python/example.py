import math
from sightline_client import Camera, box, capsule

ANNA, BEN, PILLAR = 1, 2, 3
person, pillar = capsule(radius=0.3, height=1.8), box(1, 4, 1)

def positions(time_s):  # where Anna and Ben are, in metres; +Y is up
    x = 3 * math.sin(time_s)
    return {ANNA: (x - 0.6, 0.9, 0), BEN: (x + 0.6, 0.9, 0)}

with Camera("127.0.0.1:50151", position=(0, 1.6, 6), targets={ANNA: person, BEN: person},
            occluders={PILLAR: pillar}, at={PILLAR: (0, 2, 2), **positions(0)}) as camera:
    for frame in range(300):
        reply = camera.tick(frame / 60, positions(frame / 60))
        p, seen = reply.pose.position, [f"{target.visible_share:.0%}" for target in reply.targets]
        print(f"{reply.time_s:5.2f} s  camera ({p.x:5.2f}, {p.y:5.2f}, {p.z:5.2f})  visible", *seen)
