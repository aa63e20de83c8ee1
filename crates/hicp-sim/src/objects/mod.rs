//! Procedural objects, and textures for them.

mod household;
mod paint;
mod profile;
mod shapes;
mod solid;

pub use household::{Household, Proportions};
pub use paint::Texture;
pub use solid::Solid;
