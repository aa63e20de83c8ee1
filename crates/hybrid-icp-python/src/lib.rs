//! The Python module `hybrid_icp`: refine 6D object poses in depth images from NumPy arrays.
//!
//! **Should you use this crate?** Use it from Python, through the wheel that `cargo xtask wheel`
//! builds. Rust programs depend on `hybrid-icp` directly. This crate only translates: it checks and
//! reads arrays, releases the GIL, and returns the same bits.
//!
//! ```python
//! from hybrid_icp import Camera, Model, Observation, Pipeline
//!
//! model = Model.from_file("mug.ply", unit="mm")
//! observation = Observation(depth_m, mask, Camera.from_K(K, (640, 480)))
//! result = Pipeline().refine(model, observation, T_co)
//! ```
//!
//! The doc comments of this crate become the docstrings, in the format of NumPy. The file
//! `python/hybrid_icp/_native.pyi` has the types, and `stubtest` compares it with the module.

mod align;
mod array;
mod batch;
mod bop;
mod diagnosis;
mod errors;
mod input;
mod mutex;
mod observer;
mod pipeline;
mod program;
mod results;
mod score;
mod sequence;
mod step;
mod toml;
mod warnings;

/// The native module that the package re-exports.
#[pyo3::pymodule]
#[pyo3(name = "_native")]
mod native {
    #[pymodule_export]
    use crate::{
        align::{align, read_cloud},
        bop::{PyDatasetRefiner, read_images, result_header},
        diagnosis::diagnose,
        input::camera::PyCamera,
        input::depth::PyDepthImage,
        input::image::{read_depth, read_depth_png, read_mask, read_mask_png, read_pose},
        input::model::PyModel,
        input::observation::{PyObservation, mask_in_box},
        pipeline::PyPipeline,
        program::run_program,
        score::{add, adi, mspd, mssd, mve, render_depth, vsd},
        sequence::fusion::{PyFuser, PyPoseEstimate, fuse},
        sequence::sequential::PySequentialEstimator,
        sequence::tracker::PyTracker,
        step::{point_to_plane_step, point_to_point_step},
        toml::parts,
    };
}
