//! Procedural objects, and textures for them.

mod household;
mod invented;
mod paint;
mod profile;
mod shapes;
mod solid;

pub use household::{Household, Proportions};
pub use invented::invented;
pub use paint::Texture;
pub use solid::Solid;
