//! Procedural textures of objects.

use hicp_core::internal::bounds;
use hicp_core::{ColorImage, MeshError, SurfaceColor, TexturedTriangle, TriMesh};
use rand::RngExt;

use crate::SimRng;
use crate::error::SimError;

/// Side of a texture, pixels. It covers a square as wide as the object.
const SIDE: u32 = 256;

/// The print on an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Texture {
    /// Nothing: the object has one color.
    None,
    /// Stripes of several widths and colors.
    Stripes,
    /// Some large rectangles and discs.
    Logos,
    /// Lines of small marks, like text, below a title.
    Text,
}

impl Texture {
    /// Every texture.
    pub const ALL: [Self; 4] = [Self::None, Self::Stripes, Self::Logos, Self::Text];

    /// Returns the mesh with this texture, drawn at random.
    ///
    /// Each of the six sides of the bounding box has its own image, which is projected on the
    /// triangles that face it.
    ///
    /// # Errors
    ///
    /// Never for a mesh with fewer than 2³² triangles.
    pub fn paint(self, rng: &mut SimRng, mesh: TriMesh) -> Result<TriMesh, SimError> {
        let base = color(rng);
        let images: Result<Vec<_>, _> = (0..6).map(|_| self.draw(rng, base)).collect();
        let color = SurfaceColor::Textures {
            images: images?,
            triangles: project(&mesh),
        };
        mesh.with_color(color)
            .map_err(|error: MeshError| SimError::from(error))
    }

    /// Draws one image.
    fn draw(self, rng: &mut SimRng, base: [u8; 3]) -> Result<ColorImage, SimError> {
        let mut pixels = vec![base; (SIDE * SIDE) as usize];
        let mut fill = |from: [u32; 2], to: [u32; 2], disc: bool, color: [u8; 3]| {
            let half = |axis: usize| f64::from(to[axis].saturating_sub(from[axis])).max(1.0) / 2.0;
            for v in from[1]..to[1].min(SIDE) {
                for u in from[0]..to[0].min(SIDE) {
                    let off = |axis: usize, at: u32| {
                        (f64::from(at - from[axis]) - half(axis)) / half(axis)
                    };
                    if !disc || off(0, u).hypot(off(1, v)) < 1.0 {
                        pixels[(v * SIDE + u) as usize] = color;
                    }
                }
            }
        };
        match self {
            Self::None => {}
            Self::Stripes => {
                let (mut at, upright) = (0, rng.random::<bool>());
                while at < SIDE {
                    let end = at + rng.random_range(10..50);
                    let color = color(rng);
                    match upright {
                        true => fill([at, 0], [end, SIDE], false, color),
                        false => fill([0, at], [SIDE, end], false, color),
                    }
                    at = end;
                }
            }
            Self::Logos => {
                for _ in 0..8 {
                    let from = [
                        rng.random_range(0..SIDE - 40),
                        rng.random_range(0..SIDE - 40),
                    ];
                    let to = from.map(|at| at + rng.random_range(20..90));
                    let disc = rng.random();
                    fill(from, to, disc, color(rng));
                }
            }
            Self::Text => {
                let title = color(rng);
                let band = rng.random_range(20..SIDE - 60);
                fill([20, band], [SIDE - 20, band + 30], false, title);
                for line in (0..SIDE).step_by(14) {
                    let mut at = rng.random_range(0..30);
                    while at < SIDE {
                        let end = at + rng.random_range(3..14);
                        fill([at, line], [end, line + 6], false, [30; 3]);
                        at = end + rng.random_range(3..14);
                    }
                }
            }
        }
        Ok(ColorImage::new(SIDE, SIDE, pixels)?)
    }
}

/// Draws a color.
fn color(rng: &mut SimRng) -> [u8; 3] {
    [(); 3].map(|()| rng.random_range(20..236))
}

/// Projects each triangle on the side of the bounding box that it faces.
fn project(mesh: &TriMesh) -> Vec<TexturedTriangle> {
    let [low, high] = bounds(mesh.vertices().iter().copied()).unwrap_or_default();
    let width = (high - low).amax();
    let place = |corner: f32, axis: usize| (corner - low[axis]) / width;
    (0..mesh.triangles().len())
        .map(|triangle| {
            let normal = mesh.normal(triangle).map_or([0.0; 3], |n| [n.x, n.y, n.z]);
            let axis = (0..3).max_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs()));
            let axis = axis.unwrap_or(0);
            let [s, t] = [(axis + 1) % 3, (axis + 2) % 3];
            let side = 2 * axis + usize::from(normal[axis] > 0.0);
            TexturedTriangle {
                image: u32::try_from(side).unwrap_or(0),
                corners: mesh
                    .corners(triangle)
                    .map(|corner| [place(corner[s], s), place(corner[t], t)]),
            }
        })
        .collect()
}
