//! The trait of renderers, the buffer that they fill, and the cache that avoids repeated renders.

mod cache;
mod renderer;
mod view;

pub use cache::{RenderCache, pose_bits};
pub use renderer::Renderer;
pub use view::{NO_TRIANGLE, RenderedView};
