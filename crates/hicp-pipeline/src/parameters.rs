//! Parameters that are values: declared and read by the same call.

use crate::build::Parameters;
use crate::error::PipelineError;
use crate::part::{Accepts, Parameter};
use crate::range::Range;
use crate::value::{integer, list, number};

impl Parameters<'_> {
    /// Reads a number; without a default it is required.
    pub fn number(
        &mut self,
        name: &'static str,
        range: Range,
        default: impl Into<Option<f64>>,
        meaning: &'static str,
    ) -> Result<f64, PipelineError> {
        let Range { min, max, unit } = range;
        let default = default.into();
        let accepts = Accepts::Number { min, max, default };
        let parameter = Parameter::new(name, unit, meaning, accepts);
        self.read(parameter, default, min, |value| {
            number(value).filter(|number| (min..=max).contains(number))
        })
    }

    /// Reads a whole number of at least `min`, as `u32`, `u64` or `usize`.
    pub fn count<T: TryFrom<u32>>(
        &mut self,
        name: &'static str,
        min: u32,
        default: impl Into<Option<u32>>,
        meaning: &'static str,
    ) -> Result<T, PipelineError> {
        let default = default.into();
        let parameter = Parameter::new(name, "", meaning, Accepts::Count { min, default });
        let count = self.read(parameter, default, min, |value| {
            let count = u32::try_from(integer(value)?).ok();
            count.filter(|count| *count >= min)
        })?;
        Ok(T::try_from(count).unwrap_or_else(|_| unreachable!("the type holds every u32")))
    }

    /// Reads true or false.
    pub fn flag(
        &mut self,
        name: &'static str,
        default: bool,
        meaning: &'static str,
    ) -> Result<bool, PipelineError> {
        let parameter = Parameter::new(name, "", meaning, Accepts::Flag { default });
        self.read(parameter, Some(default), default, |value| value.as_bool())
    }

    /// Reads a word and returns the value next to it; the first word is the default.
    ///
    /// # Panics
    ///
    /// Panics if there are no words.
    pub fn word<T: Copy>(
        &mut self,
        name: &'static str,
        words: &[(&'static str, T)],
        meaning: &'static str,
    ) -> Result<T, PipelineError> {
        let (_, first) = words[0];
        let known = words.iter().map(|(word, _)| *word).collect();
        let parameter = Parameter::new(name, "", meaning, Accepts::Word { words: known });
        self.read(parameter, Some(first), first, |value| {
            let named = words.iter().find(|(word, _)| value.as_str() == Some(*word));
            named.map(|(_, value)| *value)
        })
    }

    /// Reads a list of numbers, which is required.
    pub fn numbers(
        &mut self,
        name: &'static str,
        meaning: &'static str,
    ) -> Result<Vec<f64>, PipelineError> {
        let parameter = Parameter::new(name, "", meaning, Accepts::NumberList);
        self.read(parameter, None, Vec::new(), |value| {
            list(value, |entry| number(entry).filter(|x| x.is_finite()))
        })
    }

    /// Reads a list of `N` flags, all false by default.
    pub fn flags<const N: usize>(
        &mut self,
        name: &'static str,
        meaning: &'static str,
    ) -> Result<[bool; N], PipelineError> {
        let parameter = Parameter::new(name, "", meaning, Accepts::Flags { count: N });
        self.read(parameter, Some([false; N]), [false; N], |value| {
            list(value, |flag| flag.as_bool())?.try_into().ok()
        })
    }
}
