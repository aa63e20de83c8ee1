//! Reads and creates NumPy arrays, and checks shapes and types.

use hybrid_icp::core::{Isometry3, Matrix3, Matrix6, Point3, Translation3, rotation_from_matrix};
use numpy::ndarray::{ArrayView, Dimension};
use numpy::{
    AllowTypeChange, Element, PyArray1, PyArray2, PyArrayDescrMethods as _, PyArrayLikeDyn,
    PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{PyMemoryView, PyString};

use crate::errors::InputError;

/// The largest translation accepted, meters: larger ones are probably millimeters, because no depth
/// camera measures as far.
const MAX_TRANSLATION_METERS: f64 = 100.0;

/// Describes a value by its type, and arrays by dtype and shape.
pub(crate) fn describe(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => format!("{} with shape {}", kind(value), shape(array.shape())),
        Err(_) => kind(value),
    }
}

/// Describes a value by its type, and arrays by dtype.
pub(crate) fn kind(value: &Bound<'_, PyAny>) -> String {
    if let Ok(array) = value.cast::<PyUntypedArray>() {
        format!("an array of {}", array.dtype())
    } else if value.is_none() {
        "None".to_owned()
    } else {
        let name = value.get_type().name().map(|name| name.to_string());
        let name = name.unwrap_or_else(|_| "object".to_owned());
        let vowel = name.starts_with(['A', 'E', 'I', 'O', 'U', 'a', 'e', 'i', 'o', 'u']);
        format!("{} {name}", if vowel { "an" } else { "a" })
    }
}

/// Formats a shape as NumPy does.
pub(crate) fn shape(lengths: &[usize]) -> String {
    let numbers: Vec<String> = lengths.iter().map(ToString::to_string).collect();
    match &numbers[..] {
        [one] => format!("({one},)"),
        _ => format!("({})", numbers.join(", ")),
    }
}

/// Returns the choice that `word` names.
pub(crate) fn choice<T, const N: usize>(
    name: &str,
    word: &str,
    choices: [(&str, T); N],
) -> PyResult<T> {
    let words = choices.each_ref().map(|(word, _)| format!("{word:?}"));
    let mut choices = choices.into_iter();
    let chosen = choices.find_map(|(choice, value)| (choice == word).then_some(value));
    chosen.ok_or_else(|| {
        let expected = words.join(" or ");
        InputError::new_err(format!("{name} is {word:?}, expected {expected}"))
    })
}

/// Creates the error for a value of the wrong type or shape.
pub(crate) fn unexpected(name: &str, value: &Bound<'_, PyAny>, expected: &str) -> PyErr {
    let reader = match name {
        "depth" => "; read_depth reads a file",
        "mask" => "; read_mask reads a file",
        "T_co" | "T_ts" => "; read_pose reads a file",
        "source" | "target" => "; read_cloud reads a file",
        _ => "",
    };
    let is_path =
        value.is_instance_of::<PyString>() || value.hasattr("__fspath__").unwrap_or(false);
    let hint = if is_path { reader } else { "" };
    InputError::new_err(format!(
        "{name} is {}, expected {expected}{hint}",
        describe(value)
    ))
}

/// Returns anything that NumPy reads as an array, such as a tensor or a picture, as a NumPy array.
///
/// Masked arrays are refused, because NumPy would ignore their mask. If the conversion fails, as it
/// does for a tensor on a GPU, the error has the advice of its library.
pub(crate) fn as_array<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    if value.cast::<PyUntypedArray>().is_ok() {
        let masked = value.py().import("numpy.ma")?.getattr("MaskedArray")?;
        if value.is_instance(&masked)? {
            return Err(InputError::new_err(format!(
                "{name} is a masked array, expected a plain one, such as {name}.filled(0)"
            )));
        }
        return Ok(value.clone());
    }
    // Images of Open3D have neither, but they support the buffer protocol.
    let is_image = || {
        let buffer = PyMemoryView::from(value)?;
        buffer.getattr("ndim")?.extract::<usize>()
    };
    let is_array = value.hasattr("__array__")? || value.hasattr("__array_interface__")?;
    if !is_array && !is_image().is_ok_and(|dimensions| dimensions > 1) {
        return Ok(value.clone());
    }
    let numpy = value.py().import("numpy")?;
    numpy.call_method1("asarray", (value,)).map_err(|error| {
        let reason = error.value(value.py());
        InputError::new_err(format!("{name} is {}: {reason}", describe(value)))
    })
}

/// Returns an image of shape (H, W, 1) as one of shape (H, W).
pub(crate) fn without_channel<'py>(value: Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    match value.cast::<PyUntypedArray>() {
        Ok(array) if matches!(array.shape(), [_, _, 1]) => value.call_method1("squeeze", (2,)),
        _ => Ok(value),
    }
}

/// Returns the array if it is aligned, and a copy otherwise (for a field of packed records).
pub(crate) fn aligned<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    match value.cast::<PyUntypedArray>() {
        Ok(array) if !array.is_aligned() => value.call_method0("copy"),
        _ => Ok(value.clone()),
    }
}

/// Reads any array-like value into row-major numbers. `None` in `lengths` accepts any length.
pub(crate) fn numbers<T: Element + Copy>(
    value: &Bound<'_, PyAny>,
    lengths: &[Option<usize>],
    name: &str,
    expected: &str,
) -> PyResult<(Vec<T>, Vec<usize>)>
where
    for<'a, 'py> PyArrayLikeDyn<'py, T, AllowTypeChange>: FromPyObject<'a, 'py>,
{
    let value = &as_array(name, value)?;
    // Text would be parsed, and complex numbers would lose a part.
    if let Ok(array) = value.cast::<PyUntypedArray>()
        && b"SUVcmM".contains(&array.dtype().kind())
    {
        return Err(unexpected(name, value, expected));
    }
    let array = aligned(value)?
        .extract::<PyArrayLikeDyn<'_, T, AllowTypeChange>>()
        .map_err(|_| unexpected(name, value, expected))?;
    let found = array.shape();
    let fits = found.len() == lengths.len()
        && found
            .iter()
            .zip(lengths)
            .all(|(found, length)| length.is_none_or(|length| length == *found));
    if !fits {
        let what = if value.cast::<PyUntypedArray>().is_ok() || found.is_empty() {
            describe(value)
        } else {
            format!("{} of shape {}", describe(value), shape(found))
        };
        return Err(InputError::new_err(format!(
            "{name} is {what}, expected {expected}"
        )));
    }
    let numbers = row_major(&array.as_array());
    Ok((numbers, found.to_vec()))
}

/// Copies an array in row-major order.
///
/// Contiguous arrays are copied in one piece. `PyReadonlyArray::as_slice` would also accept
/// column-major arrays.
pub(crate) fn row_major<T: Copy, D: Dimension>(array: &ArrayView<'_, T, D>) -> Vec<T> {
    match array.as_slice() {
        Some(contiguous) => contiguous.to_vec(),
        None => array.iter().copied().collect(),
    }
}

/// Reads a 6×6 matrix.
pub(crate) fn matrix6(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Matrix6<f64>> {
    let (numbers, _) = numbers::<f64>(value, &[Some(6), Some(6)], name, "a (6, 6) float64 matrix")?;
    Ok(Matrix6::from_row_slice(&numbers))
}

/// Reads the rows of an array of shape (N, 3), which may have any numbers.
pub(crate) fn triples(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<Point3<f32>>> {
    let expected = "an (N, 3) array of float32";
    let (numbers, _) = numbers::<f32>(value, &[None, Some(3)], name, expected)?;
    let rows = numbers.chunks_exact(3);
    Ok(rows.map(|p| Point3::new(p[0], p[1], p[2])).collect())
}

/// Reads points from an array of shape (N, 3), meters, which must be finite.
pub(crate) fn points(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<Point3<f32>>> {
    let points = triples(value, name)?;
    for (row, point) in points.iter().enumerate() {
        if let Some(column) = point.iter().position(|x| !x.is_finite()) {
            return Err(InputError::new_err(format!(
                "{name}[{row}, {column}] is {}, expected finite numbers",
                point[column]
            )));
        }
    }
    Ok(points)
}

/// A rigid motion with the numbers that it was created from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    pub(crate) isometry: Isometry3<f64>,
    pub(crate) matrix: [f64; 16],
}

impl Motion {
    pub(crate) fn new(isometry: Isometry3<f64>) -> Self {
        let matrix = to_matrix(&isometry);
        Self { isometry, matrix }
    }
}

/// Reads the pose of an object or a camera from a 4×4 matrix, meters.
pub(crate) fn motion(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Motion> {
    let motion = motion_of_cloud(value, name)?;
    check_meters(&motion.matrix, name)?;
    Ok(motion)
}

/// Reads a rigid motion from a 4×4 matrix, meters. Clouds can be far from the origin.
pub(crate) fn motion_of_cloud(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Motion> {
    let expected = "a (4, 4) float64 matrix [R t; 0 0 0 1], meters";
    let (numbers, _) = numbers::<f64>(value, &[Some(4), Some(4)], name, expected)?;
    rigid(&numbers, name)
}

/// Reads rigid motions from an array of shape (N, 4, 4), with translations in the given unit.
pub(crate) fn motions(
    value: &Bound<'_, PyAny>,
    name: &str,
    expected: &str,
    meters_per_unit: f64,
) -> PyResult<Vec<Motion>> {
    let (mut numbers, _) = numbers::<f64>(value, &[None, Some(4), Some(4)], name, expected)?;
    (0..)
        .zip(numbers.chunks_exact_mut(16))
        .map(|(index, matrix): (usize, _)| {
            for entry in [3, 7, 11] {
                matrix[entry] *= meters_per_unit;
            }
            let name = format!("{name}[{index}]");
            check_meters(matrix, &name)?;
            rigid(matrix, &name)
        })
        .collect()
}

/// Returns an error if the translation of a 4×4 matrix is probably in millimeters.
fn check_meters(matrix: &[f64], name: &str) -> PyResult<()> {
    millimeters(matrix, name).map_or(Ok(()), |text| Err(InputError::new_err(text)))
}

/// Returns what is wrong if the translation of a 4×4 matrix is probably in millimeters.
pub(crate) fn millimeters(matrix: &[f64], name: &str) -> Option<String> {
    let [x, y, z] = [matrix[3], matrix[7], matrix[11]];
    let far = [x, y, z].iter().any(|t| t.abs() > MAX_TRANSLATION_METERS);
    far.then(|| {
        format!(
            "{name} looks like millimeters: its translation is ({x}, {y}, {z}), expected meters \
             within ±{MAX_TRANSLATION_METERS}"
        )
    })
}

/// Reads a rigid motion from 16 row-major numbers.
fn rigid(numbers: &[f64], name: &str) -> PyResult<Motion> {
    let mut matrix = [0.0; 16];
    matrix.copy_from_slice(numbers);
    for (column, expected) in [0.0, 0.0, 0.0, 1.0].into_iter().enumerate() {
        let found = matrix[12 + column];
        if found.is_nan() || (found - expected).abs() > 1e-9 {
            let transposed = [3, 7, 11, 15].map(|entry| matrix[entry]) == [0.0, 0.0, 0.0, 1.0];
            let advice = match transposed {
                true => format!(", and so is its last column: it may be transposed, pass {name}.T"),
                false => String::new(),
            };
            return Err(InputError::new_err(format!(
                "{name}[3, {column}] is {found}, expected {expected}: the last row of a pose is 0 0 0 1{advice}"
            )));
        }
    }
    let translation = [matrix[3], matrix[7], matrix[11]];
    let [x, y, z] = translation;
    if translation.iter().any(|t| !t.is_finite()) {
        return Err(InputError::new_err(format!(
            "{name} has the translation ({x}, {y}, {z}), expected finite numbers in meters"
        )));
    }
    let entries = Matrix3::from_fn(|row, column| matrix[4 * row + column]);
    let rotation = rotation_from_matrix(&entries)
        .map_err(|error| InputError::new_err(format!("{name}: {error}")))?;
    Ok(Motion {
        isometry: Isometry3::from_parts(Translation3::new(x, y, z), rotation),
        matrix,
    })
}

/// Returns a rigid motion as a row-major 4×4 matrix.
pub(crate) fn to_matrix(motion: &Isometry3<f64>) -> [f64; 16] {
    let rotation = motion.rotation.to_rotation_matrix().into_inner();
    let translation = &motion.translation.vector;
    std::array::from_fn(|i| match (i / 4, i % 4) {
        (3, 3) => 1.0,
        (3, _) => 0.0,
        (row, 3) => translation[row],
        (row, column) => rotation[(row, column)],
    })
}

/// A matrix that Python receives as an array of shape (rows, columns).
#[derive(Clone, Debug)]
pub(crate) struct Matrix<T = f64> {
    columns: usize,
    numbers: Vec<T>,
}

impl<T> Matrix<T> {
    /// Creates a matrix from row-major numbers.
    pub(crate) fn new(columns: usize, numbers: Vec<T>) -> Self {
        Self { columns, numbers }
    }
}

impl Matrix {
    /// Returns the translation of a pose as text, meters.
    pub(crate) fn translation(&self) -> String {
        let [x, y, z] = [3, 7, 11].map(|entry| self.numbers[entry]);
        format!("({x:.4}, {y:.4}, {z:.4})")
    }
}

impl From<&Isometry3<f64>> for Matrix {
    fn from(motion: &Isometry3<f64>) -> Self {
        Self::new(4, to_matrix(motion).to_vec())
    }
}

impl From<&Matrix6<f64>> for Matrix {
    fn from(matrix: &Matrix6<f64>) -> Self {
        Self::new(6, matrix.transpose().as_slice().to_vec())
    }
}

impl<'py, T: Element> IntoPyObject<'py> for Matrix<T> {
    type Target = PyArray2<T>;
    type Output = Bound<'py, PyArray2<T>>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Self::Output> {
        let rows = self.numbers.len() / self.columns.max(1);
        PyArray1::from_vec(py, self.numbers).reshape([rows, self.columns])
    }
}
