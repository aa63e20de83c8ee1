//! The catalog: every part that a pipeline file can name.

use hicp_association::{AllSamples, DataAssociation, OutlierFilter, PointSelection, Projective};
use hicp_core::internal::type_label;
use hicp_icp::{BoxedStage, Cascade, IterationLimit, Stage, StopRule};
use hicp_metric::{Minimize, PointToPoint};
use hicp_score::{MeanVsd, Score};
use hicp_switch::{Switcher, Threshold};

use crate::build::{Entry, Parameters};
use crate::error::PipelineError;
use crate::kind::{BoxedPart, PartKind};
use crate::part::Part;

/// Start of the catalog page.
const HEADING: &str = "# Catalog of parts

Every part that a pipeline file can name, written from the code by `hybrid-icp pipelines --parts`.
The name in code font after a part is its type in Rust. n counts model points, m observed ones.
";

/// The parts that a pipeline file can name.
///
/// [`Catalog::built_in`] has the parts that ship with the library. A program adds its own under a
/// name, with parameters that a file can set:
///
/// ```
/// use hicp_core::{Context, Isometry3};
/// use hicp_pipeline::range::METERS;
/// use hicp_pipeline::{Catalog, PipelineFile, PipelineLimits};
/// use hicp_score::Score;
///
/// /// Prefers poses near the camera.
/// struct Distance {
///     meters: f64,
/// }
///
/// impl Score for Distance {
///     fn score(&mut self, _: &mut Context<'_>, camera_from_object: &Isometry3<f64>) -> f64 {
///         camera_from_object.translation.vector.norm() / self.meters
///     }
/// }
///
/// # fn main() -> Result<(), hicp_pipeline::PipelineError> {
/// let mut catalog = Catalog::built_in().clone();
/// catalog.add_score("distance", |p| {
///     p.about = "Computes the distance from the camera. Cost: O(1).";
///     Ok(Distance { meters: p.number("meters", METERS, 1.0, "distance of score 1")? })
/// });
/// let file = PipelineFile::parse(
///     r#"type = "guard"
///        score = { type = "distance", meters = 2 }
///        stage = { type = "icp", selection = "all-samples", association = "projective",
///                  metric = "symmetric" }"#,
///     "mine.toml",
/// )?;
/// let stage = file.build_from(&catalog, &PipelineLimits::DEFAULT)?;
/// # let _ = stage;
/// # Ok(()) }
/// ```
#[derive(Clone, Debug, Default)]
pub struct Catalog {
    entries: Vec<Entry>,
}

/// A [`PointSelection`] of a pipeline that is read from a file.
pub type BoxedSelection = Box<dyn PointSelection + Send>;
/// A [`DataAssociation`] of a pipeline that is read from a file.
pub type BoxedAssociation = Box<dyn DataAssociation + Send>;
/// An [`OutlierFilter`] of a pipeline that is read from a file.
pub type BoxedFilter = Box<dyn OutlierFilter + Send>;
/// An error metric of a pipeline that is read from a file.
pub type BoxedMetric = Box<dyn Minimize + Send>;
/// A [`StopRule`] of a pipeline that is read from a file.
pub type BoxedStop = Box<dyn StopRule + Send>;
/// A [`Score`] of a pipeline that is read from a file.
pub type BoxedScore = Box<dyn Score + Send>;
/// A [`Switcher`] of a pipeline that is read from a file.
pub type BoxedSwitcher = Box<dyn Switcher + Send>;

/// Declares, for each kind of part: its boxed type, the method that adds one, and any part of it.
macro_rules! kinds {
    ($($kind:ident: $boxed:ty = dyn $component:path, $add:ident, $stand_in:expr;)*) => {$(
        impl BoxedPart for $boxed {
            const KIND: PartKind = PartKind::$kind;

            fn stand_in() -> Self {
                Box::new($stand_in)
            }
        }

        impl Catalog {
            #[doc = concat!("Adds a [`", stringify!($component), "`] under a name, in place of one that has it already.")]
            pub fn $add<C: $component + Send + 'static>(
                &mut self,
                name: &'static str,
                build: impl Fn(&mut Parameters<'_>) -> Result<C, PipelineError> + Send + Sync + 'static,
            ) {
                let rust = type_label::<C>();
                self.add(Entry::new(name, rust, move |parameters| {
                    Ok(Box::new(build(parameters)?) as $boxed)
                }));
            }
        }
    )*};
}

kinds! {
    Stage: BoxedStage = dyn Stage, add_stage, Cascade(Vec::<BoxedStage>::new());
    Selection: BoxedSelection = dyn PointSelection, add_selection, AllSamples;
    Association: BoxedAssociation = dyn DataAssociation, add_association, Projective;
    Filter: BoxedFilter = dyn OutlierFilter, add_filter, ();
    Metric: BoxedMetric = dyn Minimize, add_metric, PointToPoint;
    Stop: BoxedStop = dyn StopRule, add_stop_rule, IterationLimit::default();
    Score: BoxedScore = dyn Score, add_score, MeanVsd::default();
    Switcher: BoxedSwitcher = dyn Switcher, add_switcher, Threshold { score: MeanVsd::default(), alpha: 0.4 };
}

impl Catalog {
    /// Returns the parts, by kind in the order of a pipeline.
    pub fn parts(&self) -> impl Iterator<Item = &Part> {
        self.entries.iter().map(|entry| &entry.part)
    }

    /// Returns the catalog as a page of Markdown, such as `docs/catalogue.md`.
    #[must_use]
    pub fn page(&self) -> String {
        let mut page = String::from(HEADING);
        let mut section = None;
        for part in self.parts() {
            if section.replace(part.kind) != Some(part.kind) {
                let (first, rest) = part.kind.name().split_at(1);
                page += &format!("\n## {}{rest}s\n", first.to_uppercase());
            }
            page += &format!("\n### {} (`{}`)\n\n{}\n", part.name, part.rust, part.about);
            if !part.parameters.is_empty() {
                page += "\n| parameter | accepts | default | meaning |\n|---|---|---|---|\n";
            }
            for p in &part.parameters {
                let between = if p.unit.is_empty() { "" } else { "; " };
                let default = p.accepts.default();
                let default = default.as_deref().unwrap_or("required");
                let accepts = format!("{}{between}{}", p.accepts, p.unit);
                page += &format!("| `{}` | {accepts} | {default} | {} |\n", p.name, p.meaning);
            }
        }
        page
    }

    pub(crate) fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Adds an entry after those of its kind, or in place of the one that has its name.
    fn add(&mut self, entry: Entry) {
        let key = |entry: &Entry| (entry.part.kind, entry.part.name);
        let twin = |other: &Entry| key(other) == key(&entry);
        match self.entries.iter().position(twin) {
            Some(index) => self.entries[index] = entry,
            None => self.entries.push(entry),
        }
        self.entries.sort_by_key(|entry| entry.part.kind);
    }
}
