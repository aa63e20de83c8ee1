//! Builds parts, each from the fields that a file gives it.

use std::any::Any;
use std::sync::Arc;

use hicp_core::internal::nearest_name;
use hicp_icp::MAX_ITERATIONS;
use toml::de::DeValue;

use crate::error::{PipelineError, PipelineErrorKind, Place};
use crate::fields::{Fields, Spot};
use crate::kind::{BoxedPart, PartKind};
use crate::limits::PipelineLimits;
use crate::part::{Accepts, Parameter, Part};
use crate::value::describe;

/// Builds a part from its parameters.
type Build = dyn Fn(&mut Parameters<'_>) -> Result<Box<dyn Any>, PipelineError> + Send + Sync;

/// A part of a catalog and its constructor.
#[derive(Clone)]
pub(crate) struct Entry {
    pub(crate) part: Part,
    build: Arc<Build>,
}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.part.fmt(f)
    }
}

impl Entry {
    /// Creates an entry; runs the constructor once to list its parameters.
    pub(crate) fn new<K: BoxedPart>(
        name: &'static str,
        rust: &'static str,
        build: impl Fn(&mut Parameters<'_>) -> Result<K, PipelineError> + Send + Sync + 'static,
    ) -> Self {
        let mut listing = Parameters::default();
        // It reads stand-ins for required parts, which may not suit each other.
        let _ = build(&mut listing);
        Self {
            part: Part {
                kind: K::KIND,
                name,
                rust,
                about: listing.about,
                parameters: listing.declared,
            },
            build: Arc::new(move |parameters| Ok(Box::new(build(parameters)?))),
        }
    }
}

/// The parts, the limits and the file that a pipeline is built from.
#[derive(Debug)]
pub(crate) struct Context<'a> {
    pub(crate) entries: &'a [Entry],
    pub(crate) limits: &'a PipelineLimits,
    pub(crate) origin: &'a str,
    pub(crate) text: &'a str,
}

impl<'a> Context<'a> {
    /// Builds the part that a value describes; returns it with the iterations that it may take.
    pub(crate) fn part<K: BoxedPart>(
        &'a self,
        value: &'a DeValue<'a>,
        spot: Spot,
    ) -> Result<(K, u64), PipelineError> {
        let kind = K::KIND;
        let fields = Fields::new(value.as_table(), spot);
        let (name, spot) = match value {
            DeValue::String(_) => (Some(value), fields.spot.clone()),
            DeValue::Table(_) => fields.field("type"),
            _ => {
                let expected = format!("{}: a name, or a table with `type`", kind.any());
                return Err(self.refuse(Some(value), &fields.spot, expected));
            }
        };
        match name.and_then(|name| name.as_str()) {
            Some(name) => self.named(name, &spot, fields),
            None => {
                let known = self.names(kind).join(", ");
                Err(self.refuse(name, &spot, format!("the name of {}: {known}", kind.any())))
            }
        }
    }

    /// Builds the part of a name, which stands at `spot`, from its fields.
    fn named<K: BoxedPart>(
        &'a self,
        name: &str,
        spot: &Spot,
        fields: Fields<'a>,
    ) -> Result<(K, u64), PipelineError> {
        let mut entries = self.entries.iter();
        let Some(entry) = entries.find(|e| e.part.kind == K::KIND && e.part.name == name) else {
            let problem = format!("no {} is named {name:?}", K::KIND.name());
            return Err(self.unknown(spot, problem, (name, None), self.names(K::KIND)));
        };
        let known = || entry.part.parameters.iter().map(|p| p.name);
        for field in fields.names() {
            if field != "type" && !known().any(|name| name == field) {
                let problem = format!("{name} has no such field");
                let (_, spot) = fields.field(field);
                let nested = fields.nested(field);
                return Err(self.unknown(&spot, problem, (field, nested), known().collect()));
            }
        }
        let mut parameters = Parameters {
            reading: Some((self, fields)),
            ..Parameters::default()
        };
        let built = (entry.build)(&mut parameters)?;
        let alone = match K::KIND {
            PartKind::Stop => MAX_ITERATIONS as u64,
            _ => 1,
        };
        let inner = parameters.inner.iter().map(|(_, iterations)| *iterations);
        let iterations = parameters.iterations.or(inner.max()).unwrap_or(alone);
        match built.downcast::<K>() {
            Ok(part) => Ok((*part, iterations)),
            Err(_) => unreachable!("an entry builds the type of its kind"),
        }
    }

    fn names(&self, kind: PartKind) -> Vec<&'static str> {
        let parts = self.entries.iter().map(|entry| &entry.part);
        let named = parts.filter(|part| part.kind == kind);
        named.map(|part| part.name).collect()
    }

    /// Returns the error of a field that is missing, or whose value is not accepted.
    fn refuse(&self, found: Option<&DeValue<'_>>, spot: &Spot, expected: String) -> PipelineError {
        let (kind, found) = match found.map(describe) {
            Some(found) => (PipelineErrorKind::Value, format!("found {found}")),
            None => (PipelineErrorKind::Missing, "missing".to_owned()),
        };
        self.error(kind, spot, format!("{found}, expected {expected}"))
    }

    fn unknown(
        &self,
        spot: &Spot,
        mut problem: String,
        (name, elsewhere): (&str, Option<String>),
        known: Vec<&'static str>,
    ) -> PipelineError {
        let nearest = nearest_name(name, known.iter().copied()).map(str::to_owned);
        if let Some(name) = nearest.or(elsewhere) {
            problem += &format!("; did you mean {name:?}?");
        }
        let known = match &known[..] {
            [] => "none".to_owned(),
            _ => known.join(", "),
        };
        let problem = format!("{problem}; there are: {known}");
        self.error(PipelineErrorKind::Unknown, spot, problem)
    }

    /// Returns an error at a field of the file.
    pub(crate) fn error(
        &self,
        kind: PipelineErrorKind,
        spot: &Spot,
        problem: String,
    ) -> PipelineError {
        let place = Place::of(self.origin, self.text, spot.start, &spot.field);
        PipelineError::new(kind, place, problem)
    }
}

/// The parameters of a part, as its constructor reads them.
///
/// Each call declares a parameter (name, accepted values, default, meaning) and returns its value.
/// A catalog runs a constructor once without a file to list its parameters: read all of them,
/// whatever their values, before anything is refused.
///
/// The methods fail with a [`PipelineError`] that names the line, the field, the value found and
/// what was expected.
#[derive(Debug, Default)]
pub struct Parameters<'a> {
    /// Description for the catalog: effect, source and cost.
    pub about: &'static str,
    /// `None` while the parameters are being listed.
    pub(crate) reading: Option<(&'a Context<'a>, Fields<'a>)>,
    declared: Vec<Parameter>,
    /// The inner parts: the field of each, and the iterations that it may take.
    pub(crate) inner: Vec<(&'static str, u64)>,
    /// The iterations that the part may take, where they are not those of its longest inner part.
    pub(crate) iterations: Option<u64>,
}

impl Parameters<'_> {
    /// Declares a parameter, and reads it with `accepted`, which returns `None` for other values.
    /// Without a default it is required; `stand_in` is its value while parameters are being listed.
    pub(crate) fn read<T>(
        &mut self,
        parameter: Parameter,
        default: Option<T>,
        stand_in: T,
        accepted: impl FnOnce(&DeValue<'_>) -> Option<T>,
    ) -> Result<T, PipelineError> {
        let Some((context, fields)) = &self.reading else {
            self.declared.push(parameter);
            return Ok(default.unwrap_or(stand_in));
        };
        let (found, spot) = fields.field(parameter.name);
        let value = match found {
            Some(found) => accepted(found),
            None => default,
        };
        value.ok_or_else(|| context.refuse(found, &spot, parameter.accepts.to_string()))
    }

    /// Reads a part; without the name of a default it is required.
    pub fn part<K: BoxedPart>(
        &mut self,
        name: &'static str,
        default: impl Into<Option<&'static str>>,
        meaning: &'static str,
    ) -> Result<K, PipelineError> {
        let (kind, default) = (K::KIND, default.into());
        let accepts = Accepts::Part { kind, default };
        let Some((context, fields)) = &self.reading else {
            self.declared
                .push(Parameter::new(name, "", meaning, accepts));
            return Ok(K::stand_in());
        };
        let (part, iterations) = match (fields.field(name), default) {
            ((Some(value), spot), _) => context.part(value, spot)?,
            ((None, spot), Some(part)) => {
                context.named(part, &spot, Fields::new(None, spot.clone()))?
            }
            ((None, spot), None) => {
                let known = context.names(kind).join(", ");
                return Err(context.refuse(None, &spot, format!("{accepts}: {known}")));
            }
        };
        self.inner.push((name, iterations));
        Ok(part)
    }

    /// Reads a list of parts; without the names of a default it is required.
    pub fn parts<K: BoxedPart>(
        &mut self,
        name: &'static str,
        default: impl Into<Option<&'static [&'static str]>>,
        meaning: &'static str,
    ) -> Result<Vec<K>, PipelineError> {
        let (kind, default) = (K::KIND, default.into());
        let accepts = Accepts::Parts { kind, default };
        let Some((context, fields)) = &self.reading else {
            self.declared
                .push(Parameter::new(name, "", meaning, accepts));
            return Ok(Vec::new());
        };
        let (found, spot) = fields.field(name);
        let mut parts = Vec::new();
        let mut add = |built: Result<(K, u64), PipelineError>| {
            let (part, iterations) = built?;
            self.inner.push((name, iterations));
            parts.push(part);
            Ok::<_, PipelineError>(())
        };
        match (found, default) {
            (Some(DeValue::Array(items)), _) => {
                for (index, item) in items.iter().enumerate() {
                    let spot = spot.inside(&index.to_string(), item.span().start);
                    add(context.part(item.get_ref(), spot))?;
                }
            }
            (None, Some(defaults)) => {
                for default in defaults {
                    add(context.named(default, &spot, Fields::new(None, spot.clone())))?;
                }
            }
            _ => return Err(context.refuse(found, &spot, accepts.to_string())),
        }
        Ok(parts)
    }

    /// Returns whether a field is given.
    pub(crate) fn has(&self, field: &str) -> bool {
        let mut reading = self.reading.iter();
        reading.any(|(_, fields)| fields.field(field).0.is_some())
    }

    /// Returns the error of a value that is wrong only together with others.
    #[must_use]
    pub fn refuse(&self, field: &str, expected: String) -> PipelineError {
        let Some((context, fields)) = &self.reading else {
            let problem = format!("missing, expected {expected}");
            return PipelineError::new(PipelineErrorKind::Missing, Box::default(), problem);
        };
        let (found, spot) = fields.field(field);
        context.refuse(found, &spot, expected)
    }
}
