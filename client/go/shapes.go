package sightline

import v1 "sightline.dev/go/sightline/v1"

// Vec makes a vector.
func Vec(x, y, z float64) *v1.Vec3 { return &v1.Vec3{X: x, Y: y, Z: z} }

// Box makes a box from its whole sizes along x, y and z. A ground or a wall is a flat box. Like every shape, it is centred on the place
// of its instance.
func Box(width, height, depth float64) *v1.Shape {
	return &v1.Shape{Shape: &v1.Shape_Box_{Box: &v1.Shape_Box{HalfExtent: Vec(width/2, height/2, depth/2)}}}
}

// Sphere makes a ball.
func Sphere(radius float64) *v1.Shape {
	return &v1.Shape{Shape: &v1.Shape_Sphere_{Sphere: &v1.Shape_Sphere{Radius: radius}}}
}

// Capsule makes an upright capsule; height is from end to end.
func Capsule(radius, height float64) *v1.Shape {
	return &v1.Shape{Shape: &v1.Shape_Capsule_{Capsule: &v1.Shape_Capsule{Radius: radius, HalfHeight: height/2 - radius}}}
}

// Instance makes an instance for the opening.
func Instance(id uint64, shape *v1.Shape, position *v1.Vec3) *v1.NewInstance {
	return &v1.NewInstance{Id: id, Geometry: &v1.NewInstance_Shape{Shape: shape}, Pose: &v1.Pose3{Position: position}}
}

// Move adds the place of an instance to the transforms of a tick.
func Move(transforms *v1.Transforms, id uint64, x, y, z float64) {
	transforms.Ids = append(transforms.Ids, id)
	transforms.Positions = append(transforms.Positions, x, y, z)
}
