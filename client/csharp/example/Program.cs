using System;
using System.Threading.Tasks;
using Sightline.Client;
using Sightline.V1;

// Two people walk to and fro in front of a pillar.
static class Program {
    const ulong Anna = 1, Ben = 2, Pillar = 3;

    static NewInstance Instance(ulong id, Shape shape, double x, double y, double z) {
        return new NewInstance { Id = id, Shape = shape, Pose = new Pose3 { Position = new Vec3 { X = x, Y = y, Z = z } } };
    }

    static void Main(string[] arguments) {
        Film(arguments.Length > 0 ? arguments[0] : "http://127.0.0.1:50151").GetAwaiter().GetResult();
    }

    static async Task Film(string address) {
        var person = new Shape { Capsule = new Shape.Types.Capsule { Radius = 0.3, HalfHeight = 0.6 } };
        var pillar = new Shape { Box = new Shape.Types.Box { HalfExtent = new Vec3 { X = 0.5, Y = 2, Z = 0.5 } } };
        var opening = new OpenSession { Camera = new Pose3 { Position = new Vec3 { Y = 1.6, Z = 6 } } };
        opening.Instances.Add(Instance(Anna, person, -0.6, 0.9, 0));
        opening.Instances.Add(Instance(Ben, person, 0.6, 0.9, 0));
        opening.Instances.Add(Instance(Pillar, pillar, 0, 2, 2));
        opening.Targets.Add(new Target { Id = Anna });
        opening.Targets.Add(new Target { Id = Ben });

        using (var camera = await SightlineCamera.OpenAsync(new[] { address }, opening)) {
            for (int frame = 0; frame < 300; ++frame) {
                double x = 3 * Math.Sin(frame / 60.0);
                var moved = new Transforms();
                moved.Ids.Add(new[] { Anna, Ben });
                moved.Positions.Add(new[] { x - 0.6, 0.9, 0, x + 0.6, 0.9, 0 });
                var reply = await camera.TickAsync(new Tick { TimeS = frame / 60.0, Transforms = moved });
                var p = reply.Pose.Position;
                Console.WriteLine($"{reply.TimeS:F2} s  camera ({p.X:F2}, {p.Y:F2}, {p.Z:F2})  {reply.ReasonText}");
            }
            await camera.CloseAsync();
        }
    }
}
