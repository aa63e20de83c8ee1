//! Reads and creates color images and the colors of meshes.

use hybrid_icp::core::{ColorImage, SurfaceColor, TexturedTriangle};
use numpy::{
    PyArray1, PyArray3, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray3, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::array::{self, Matrix, unexpected};
use crate::errors;

/// Reads a color image, of this width and height if it is stated.
pub(crate) fn image(
    value: &Bound<'_, PyAny>,
    name: &str,
    size: Option<(u32, u32)>,
) -> PyResult<ColorImage> {
    let value = &array::as_array(name, value)?;
    let expected = match size {
        Some((width, height)) => {
            format!("an array of uint8 with the size of depth, ({height}, {width}, 3)")
        }
        None => "an (H, W, 3) array of uint8".to_owned(),
    };
    let refuse = || unexpected(name, value, &expected);
    let pixels = value.extract::<PyReadonlyArray3<'_, u8>>();
    let pixels = pixels.map_err(|_| refuse())?;
    let (rows, columns, channels) = pixels.as_array().dim();
    let side = |length: usize| u32::try_from(length).map_err(|_| refuse());
    let found = (side(columns)?, side(rows)?);
    if channels != 3 || size.is_some_and(|size| size != found) {
        return Err(refuse());
    }
    let bytes = array::row_major(&pixels.as_array());
    ColorImage::from_rgb(found.0, found.1, &bytes).map_err(errors::input)
}

/// Returns an image that Python receives as an array of shape (H, W, 3).
pub(crate) fn to_numpy<'py>(
    py: Python<'py>,
    image: &ColorImage,
) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let bytes = PyArray1::from_slice(py, image.pixels().as_flattened());
    bytes.reshape([image.height() as usize, image.width() as usize, 3])
}

/// Images, the image of each face, and its corners in it.
type Textures<'py> = (Vec<Bound<'py, PyAny>>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// Reads the colors of a mesh: an array of vertex colors, or textures.
pub(crate) fn surface(value: &Bound<'_, PyAny>) -> PyResult<SurfaceColor> {
    if let Ok((images, of_faces, corners)) = value.extract::<Textures<'_>>() {
        let images = images.iter().map(|value| image(value, "colors[0]", None));
        let images = images.collect::<PyResult<Vec<_>>>()?;
        let expected = "an (F,) array of the indices of images";
        let (of_faces, _) = array::numbers::<u32>(&of_faces, &[None], "colors[1]", expected)?;
        let expected = "an (F, 3, 2) array of texture coordinates";
        let lengths = [Some(of_faces.len()), Some(3), Some(2)];
        let (corners, _) = array::numbers::<f32>(&corners, &lengths, "colors[2]", expected)?;
        let faces = of_faces.iter().zip(corners.chunks_exact(6));
        let triangles = faces.map(|(image, c)| TexturedTriangle {
            image: *image,
            corners: [[c[0], c[1]], [c[2], c[3]], [c[4], c[5]]],
        });
        let triangles = triangles.collect();
        return Ok(SurfaceColor::Textures { images, triangles });
    }
    let value = &array::as_array("colors", value)?;
    let expected = "a (V, 3) array of uint8, or (images, indices, corners)";
    // Other types may be fractions of 1 or of 65535.
    if let Ok(array) = value.cast::<PyUntypedArray>()
        && !array.dtype().is_equiv_to(&numpy::dtype::<u8>(value.py()))
    {
        return Err(unexpected("colors", value, expected));
    }
    let (bytes, _) = array::numbers::<u8>(value, &[None, Some(3)], "colors", expected)?;
    let (colors, _) = bytes.as_chunks();
    Ok(SurfaceColor::Vertices(colors.to_vec()))
}

/// Returns the colors of a mesh as [`surface`] reads them.
pub(crate) fn of_surface<'py>(
    py: Python<'py>,
    color: &SurfaceColor,
) -> PyResult<Bound<'py, PyAny>> {
    match color {
        SurfaceColor::Vertices(colors) => {
            let bytes = colors.as_flattened().to_vec();
            Ok(Matrix::new(3, bytes).into_pyobject(py)?.into_any())
        }
        SurfaceColor::Textures { images, triangles } => {
            let images = images.iter().map(|image| to_numpy(py, image));
            let images = images.collect::<PyResult<Vec<_>>>()?;
            let of_faces = triangles.iter().map(|triangle| triangle.image);
            let of_faces = PyArray1::from_iter(py, of_faces);
            let corners = triangles
                .iter()
                .flat_map(|t| t.corners.into_iter().flatten());
            let corners = PyArray1::from_iter(py, corners).reshape([triangles.len(), 3, 2])?;
            Ok((images, of_faces, corners).into_pyobject(py)?.into_any())
        }
    }
}
