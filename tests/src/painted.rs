//! Textured objects on a table, under changing light.

use std::sync::Arc;

use hicp_sim::{Household, Lighting, SimError, Texture, stream};
use hybrid_icp::core::{Isometry3, Model, Observation};

use crate::tabletop::{MaskKind, Seen, Tabletop};

/// Textured objects, and the rotations that the depth alone cannot tell apart.
#[derive(Debug)]
pub struct Painted {
    /// The scenes.
    pub scenes: Tabletop,
    /// Per object, the symmetries of its shape.
    pub motions: Vec<Vec<Isometry3<f64>>>,
}

impl Painted {
    /// Paints every object with every texture of a list.
    ///
    /// # Errors
    ///
    /// If a model cannot be built.
    pub fn new(objects: &[Household], textures: &[Texture]) -> Result<Self, SimError> {
        let (mut models, mut motions) = (Vec::new(), Vec::new());
        for (index, object) in (0..).zip(objects) {
            for texture in textures {
                let plain = object.model()?;
                let name = format!("{} {texture:?}", object.name());
                let mut random = stream(7, &["paint", &name], index);
                let mesh = texture.paint(&mut random, plain.mesh().clone())?;
                // The texture breaks the symmetries of the shape, so none is declared.
                models.push((name, Model::new(mesh)));
                motions.push(plain.symmetries().motions());
            }
        }
        Ok(Self {
            scenes: Tabletop::of(models),
            motions,
        })
    }

    /// Returns the observation of an object with a color image.
    ///
    /// # Errors
    ///
    /// Never with the sizes of a scene.
    pub fn observe(
        &self,
        seen: &Seen,
        mask: MaskKind,
        lighting: &Lighting,
        seed: u64,
    ) -> Result<Observation, SimError> {
        let model = &self.scenes.objects[seen.model].1;
        let mut random = stream(seed, &["photo"], 0);
        let (truth, camera) = (&seen.truth, &seen.camera);
        let photo = lighting.photograph(&mut random, model, truth, &seen.visible, camera)?;
        let mask = mask.apply(&seen.visible)?;
        let observation = Observation::new(Arc::clone(&seen.depth), mask, seen.camera)?;
        Ok(observation.with_color(photo)?)
    }
}
