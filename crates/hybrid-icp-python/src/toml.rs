//! Parts of pipelines as Python values.

use hybrid_icp::pipeline::Catalog;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::array;

/// Writes a Python value as TOML: a bool, a number, a string, a dict or a sequence.
pub(crate) fn value(value: &Bound<'_, PyAny>) -> PyResult<String> {
    // Extraction also accepts `numpy.bool_`, and NumPy's numbers have these methods.
    if let Ok(flag) = value.extract::<bool>() {
        Ok(flag.to_string())
    } else if let Ok(number) = value.call_method0("__index__") {
        Ok(number.repr()?.to_string())
    } else if let Ok(text) = value.cast::<PyString>() {
        Ok(quoted(&text.to_string()))
    } else if let Ok(dict) = value.cast::<PyDict>() {
        let entries = dict
            .iter()
            .map(|(key, item)| Ok(format!("{key} = {}", self::value(&item)?)));
        let entries: PyResult<Vec<String>> = entries.collect();
        Ok(format!("{{ {} }}", entries?.join(", ")))
    } else if let Ok(items) = value.try_iter() {
        let items: PyResult<Vec<String>> = items.map(|item| self::value(&item?)).collect();
        Ok(format!("[{}]", items?.join(", ")))
    } else if let Ok(number) = value.call_method0("__float__") {
        Ok(number.repr()?.to_string())
    } else {
        let expected = "a bool, a number, a string, a list or a dict";
        Err(array::unexpected("a field of a pipeline", value, expected))
    }
}

/// Writes a string as TOML. The escapes of Rust are others.
fn quoted(text: &str) -> String {
    let escaped = text.chars().map(|c| match c {
        '"' | '\\' => format!("\\{c}"),
        c if c.is_control() => format!("\\u{:04X}", u32::from(c)),
        c => c.to_string(),
    });
    format!("\"{}\"", escaped.collect::<String>())
}

/// Reads overrides: a dict, or a sequence of assignments.
pub(crate) fn overrides(overrides: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<String>> {
    let Some(overrides) = overrides else {
        return Ok(Vec::new());
    };
    let unexpected = |_| {
        let expected = "a dict such as {\"times\": 3}, or a list such as [\"times=3\"]";
        array::unexpected("overrides", overrides, expected)
    };
    if let Ok(fields) = overrides.cast::<PyDict>() {
        let assign = |(key, item)| -> PyResult<String> {
            let item: Bound<'_, PyAny> = item;
            Ok(format!("{key}={}", value(&item)?))
        };
        fields.iter().map(assign).collect()
    } else {
        // A string is a sequence of strings, too, and PyO3 refuses it.
        overrides.extract().map_err(unexpected)
    }
}

/// Returns the parts of which pipelines are made, with their parameters.
///
/// Returns
/// -------
/// list of dict
///     The keys `kind` (such as "metric"), `type` (the name in pipelines), `about` and
///     `parameters`: a list of dicts with `name`, `accepts`, `default` (None if the parameter is
///     required), `unit` and `meaning`.
///
/// Examples
/// --------
/// >>> from hybrid_icp import parts
/// >>> [part["type"] for part in parts() if part["kind"] == "metric"][:2]
/// ['point-to-point', 'point-to-plane']
#[pyfunction]
pub(crate) fn parts(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let dict = |entries: &[(&str, Option<&str>)]| {
        let dict = PyDict::new(py);
        for (key, text) in entries {
            dict.set_item(key, text)?;
        }
        PyResult::Ok(dict)
    };
    let parts = Catalog::built_in().parts().map(|part| {
        let parameters = part.parameters.iter().map(|parameter| {
            dict(&[
                ("name", Some(parameter.name)),
                ("accepts", Some(&parameter.accepts.to_string())),
                ("default", parameter.accepts.default().as_deref()),
                ("unit", Some(parameter.unit)),
                ("meaning", Some(parameter.meaning)),
            ])
        });
        let parameters: PyResult<Vec<_>> = parameters.collect();
        let (kind, name) = (part.kind.name(), part.name);
        let entries = [("kind", kind), ("type", name), ("about", part.about)];
        let dict = dict(&entries.map(|(key, text)| (key, Some(text))))?;
        dict.set_item("parameters", parameters?)?;
        Ok(dict)
    });
    parts.collect()
}
