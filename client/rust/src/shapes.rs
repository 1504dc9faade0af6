//! Short ways to write shapes and places.
use crate::v1::{new_instance::Geometry, shape, NewInstance, Pose3, Shape, Transforms, Vec3};

pub fn vector([x, y, z]: [f64; 3]) -> Vec3 {
    Vec3 { x, y, z }
}

/// A box from its whole sizes along x, y and z. A ground or a wall is a flat box. Like every shape, it is centred on the place of its
/// instance.
pub fn box_shape(width: f64, height: f64, depth: f64) -> Shape {
    let half_extent = Some(vector([width / 2.0, height / 2.0, depth / 2.0]));
    Shape { shape: Some(shape::Shape::Box(shape::Box { half_extent })), ..Default::default() }
}

pub fn sphere(radius: f64) -> Shape {
    Shape { shape: Some(shape::Shape::Sphere(shape::Sphere { radius })), ..Default::default() }
}

/// An upright capsule; `height` is from end to end.
pub fn capsule(radius: f64, height: f64) -> Shape {
    Shape { shape: Some(shape::Shape::Capsule(shape::Capsule { radius, half_height: height / 2.0 - radius })), ..Default::default() }
}

/// An instance for the opening.
pub fn instance(id: u64, shape: Shape, position: [f64; 3]) -> NewInstance {
    let pose = Some(Pose3 { position: Some(vector(position)), rotation: None });
    NewInstance { id, geometry: Some(Geometry::Shape(shape)), pose, ..Default::default() }
}

/// Where instances are now, for a tick; the others stay where they are.
pub fn transforms(places: &[(u64, [f64; 3])]) -> Transforms {
    Transforms {
        ids: places.iter().map(|(id, _)| *id).collect(),
        positions: places.iter().flat_map(|(_, position)| *position).collect(),
        ..Default::default()
    }
}
