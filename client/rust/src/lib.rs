//! Steers a camera that keeps several moving targets in view, by a Sightline daemon.
//!
//! A [`Camera`] is a session. [`Camera::tick`] sends what has changed and returns where the camera goes. A game whose frame must not wait uses a
//! [`LiveCamera`]. The messages are in [`v1`]; the
//! comments of the contract, in `proto/sightline/v1`, describe every field.
mod camera;
mod display;
mod errors;
mod following;
mod live;
mod rotations;
mod sampler;
mod shapes;
mod snapshot;
mod stream;
mod waiting;

pub use camera::{Camera, Options, Scene};
pub use display::Source;
pub use errors::{Error, Failed};
pub use following::Drawn;
pub use live::{LiveCamera, LiveOptions, LiveView};
pub use rotations::{Quaternion, Vector};
pub use sampler::{PoseSampler, Sample};
pub use shapes::{box_shape, capsule, instance, sphere, transforms, vector};
pub use tonic::transport::{Certificate, ClientTlsConfig, Identity};
pub use tonic::Code;

/// The generated messages, in modules that mirror their packages. Some details of errors are not used.
#[allow(clippy::all, dead_code)]
mod generated {
    pub mod sightline {
        pub mod v1 {
            tonic::include_proto!("sightline.v1");
        }
        pub mod tuning {
            pub mod v1alpha1 {
                tonic::include_proto!("sightline.tuning.v1alpha1");
            }
        }
    }
    pub mod google {
        pub mod rpc {
            tonic::include_proto!("google.rpc");
        }
    }
}
pub use generated::sightline::{tuning::v1alpha1 as tuning, v1};
