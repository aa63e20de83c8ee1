//! Names of result files.

use std::path::Path;

/// The parts of a result file's name, `METHOD_DATASET-SPLIT[-SPLITTYPE][_ID].csv`.
///
/// ```
/// use hicp_io::bop::ResultFileName;
/// let name = ResultFileName::parse("results/hicp_tless-test-primesense_2.csv").ok_or("no result file")?;
/// assert_eq!((name.method.as_str(), name.dataset.as_str()), ("hicp", "tless"));
/// assert_eq!(name.split_folder(), "test_primesense");
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResultFileName {
    /// The method, without underscores.
    pub method: String,
    /// The dataset, such as `ycbv`.
    pub dataset: String,
    /// The split, such as `test`.
    pub split: String,
    /// The sensor or kind of the split, such as `primesense`.
    pub split_type: Option<String>,
    /// An identifier that distinguishes several results of one method.
    pub id: Option<String>,
}

impl ResultFileName {
    /// Parses the name of a file, or returns `None` if it does not have this form.
    #[must_use]
    pub fn parse(path: impl AsRef<Path>) -> Option<Self> {
        let name = path.as_ref().file_name()?.to_str()?.strip_suffix(".csv")?;
        let (method, rest) = name.split_once('_')?;
        let (data, id) = match rest.split_once('_') {
            Some((data, id)) => (data, Some(id)),
            None => (rest, None),
        };
        let mut parts = data.splitn(3, '-');
        let (dataset, split, split_type) = (parts.next()?, parts.next()?, parts.next());
        let required = [method, dataset, split];
        let optional = [split_type, id];
        if required.iter().any(|part| part.is_empty()) || optional.contains(&Some("")) {
            return None;
        }
        Some(Self {
            method: method.to_owned(),
            dataset: dataset.to_owned(),
            split: split.to_owned(),
            split_type: split_type.map(str::to_owned),
            id: id.map(str::to_owned),
        })
    }

    /// Returns the name of the split's folder in the dataset: `SPLIT` or `SPLIT_SPLITTYPE`.
    #[must_use]
    pub fn split_folder(&self) -> String {
        match &self.split_type {
            Some(split_type) => format!("{}_{split_type}", self.split),
            None => self.split.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_another_form_are_refused() {
        let name = ResultFileName::parse("cosypose-x_ycbv-test.csv").unwrap();
        assert_eq!(name.split_folder(), "test");
        assert_eq!((name.method.as_str(), name.id), ("cosypose-x", None));
        for bad in [
            "ycbv-test.csv",
            "a_ycbv.csv",
            "a_ycbv-test.json",
            "_ycbv-test.csv",
            "a_ycbv-.csv",
            "a_b-c_.csv",
            "",
        ] {
            assert_eq!(ResultFileName::parse(bad), None, "{bad}");
        }
    }
}
