//! `hybrid-icp inspect`.

use std::path::PathBuf;

use clap::Args;
use hicp_io::LengthUnit;
use hybrid_icp::{Facing, MeshSurvey, Model, TriMesh};
use serde::Serialize;

use crate::limits::limits;
use crate::terminal::say;

/// Say what a mesh file holds as it is read here: counts, size, whether it is closed, and what looks wrong.
///
/// Polygons are counted as the triangles they are cut into. With --json the keys are triangles, vertices, diameter_m, closed,
/// warnings (a list of sentences, empty when nothing looks wrong) and more of the kind.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  hybrid-icp inspect mug.ply --unit mm

Exit codes: 0 the file can be read, with or without warnings; 1 it cannot, and
the message says where it is broken; 2 the command line is wrong.")]
pub(crate) struct Arguments {
    /// The mesh: OBJ, OFF, PLY or STL.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Unit of the mesh's coordinates: m, mm or cm.
    #[arg(long, value_name = "UNIT", default_value_t = LengthUnit::Meters)]
    unit: LengthUnit,
    /// Write JSON instead of text.
    #[arg(long)]
    json: bool,
}

/// Diameters that an object to be grasped or looked at may have, metres.
const PLAUSIBLE_METERS: std::ops::RangeInclusive<f64> = 0.005..=5.0;

/// Steps of the coordinates that are too coarse, as a share of the diameter.
const COARSE: f64 = 1e-4;

#[derive(Debug, Serialize)]
struct Report {
    file: String,
    unit: String,
    triangles: usize,
    vertices: usize,
    diameter_m: f64,
    /// Every edge has exactly two triangles.
    closed: bool,
    warnings: Vec<String>,
    bounding_box_m: [[f32; 3]; 2],
    area_m2: f64,
    /// `outward`, `inward`, or `unknown` where the mesh does not tell.
    facing: &'static str,
    consistently_wound: bool,
    components: usize,
    boundary_edges: usize,
    non_manifold_edges: usize,
    degenerate_triangles: usize,
    duplicate_triangles: usize,
    unused_vertices: usize,
    /// The unit that would give the mesh the size of an object, where that of the command line does not.
    suspected_unit: Option<String>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mesh = limits().read_mesh(&arguments.file, arguments.unit)?;
    let report = Report::of(arguments, mesh);
    if arguments.json {
        return say(serde_json::to_string_pretty(&report)?);
    }
    say(report.text())
}

impl Report {
    fn of(arguments: &Arguments, mesh: TriMesh) -> Self {
        let survey = mesh.survey();
        let (facing, step) = (mesh.facing(), mesh.coordinate_step());
        let model = Model::new(mesh);
        let (mesh, diameter_m) = (model.mesh(), model.diameter());
        let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for vertex in mesh.used_points() {
            for axis in 0..3 {
                bounds[0][axis] = bounds[0][axis].min(vertex[axis]);
                bounds[1][axis] = bounds[1][axis].max(vertex[axis]);
            }
        }
        let suspected = suspected_unit(diameter_m, arguments.unit);
        let mut report = Self {
            file: arguments.file.display().to_string(),
            unit: arguments.unit.to_string(),
            triangles: mesh.triangles().len(),
            vertices: mesh.vertices().len(),
            diameter_m,
            closed: survey.is_watertight(),
            warnings: Vec::new(),
            bounding_box_m: bounds,
            area_m2: mesh.area(),
            facing: match facing {
                Facing::Outward => "outward",
                Facing::Inward => "inward",
                Facing::Unknown => "unknown",
            },
            consistently_wound: survey.misoriented_edges == 0,
            components: survey.components,
            boundary_edges: survey.boundary_edges,
            non_manifold_edges: survey.non_manifold_edges,
            degenerate_triangles: survey.degenerate_triangles,
            duplicate_triangles: survey.duplicate_triangles,
            unused_vertices: survey.unused_vertices,
            suspected_unit: suspected.map(|unit| unit.to_string()),
        };
        report.warnings = report.warnings(&survey, step);
        report
    }

    /// What looks wrong, in sentences.
    fn warnings(&self, survey: &MeshSurvey, step: f64) -> Vec<String> {
        let mut warnings = Vec::new();
        let diameter = self.diameter_m;
        if !PLAUSIBLE_METERS.contains(&diameter) {
            let hint = match &self.suspected_unit {
                Some(unit) => format!("; in {unit} it would be an object's size"),
                None => String::new(),
            };
            warnings.push(format!(
                "the diameter is {diameter:.4e} m in {}, expected {} to {} m{hint}",
                self.unit,
                PLAUSIBLE_METERS.start(),
                PLAUSIBLE_METERS.end()
            ));
        }
        if step > COARSE * diameter {
            warnings.push(format!(
                "the coordinates are so far from the origin that they are rounded to steps of {step:.1e} m: move the mesh to its origin"
            ));
        }
        let counts = [
            (
                survey.boundary_edges,
                "edges have one triangle only: the surface is open",
            ),
            (
                survey.non_manifold_edges,
                "edges have more than two triangles",
            ),
            (
                survey.misoriented_edges,
                "edges have triangles that are wound against each other: normals cannot be trusted",
            ),
            (survey.degenerate_triangles, "triangles have no area"),
            (survey.duplicate_triangles, "triangles repeat another"),
            (survey.unused_vertices, "vertices belong to no triangle"),
        ];
        let told = counts.iter().filter(|(count, _)| *count > 0);
        warnings.extend(told.map(|(count, what)| format!("{count} {what}")));
        if self.facing == "inward" {
            warnings.push(
                "the triangles are wound clockwise seen from outside: normals point inward"
                    .to_owned(),
            );
        }
        warnings
    }

    fn text(&self) -> String {
        let [low, high] = self.bounding_box_m;
        let sides = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        let closed = if self.closed { "closed" } else { "open" };
        let mut text = format!(
            "{}: {} triangles, {} vertices, {} parts, {closed}, facing {}\n  diameter {:.6} m, box {:.6} x {:.6} x {:.6} m from ({}, {}, {}), area {:.6} m2",
            self.file,
            self.triangles,
            self.vertices,
            self.components,
            self.facing,
            self.diameter_m,
            sides[0],
            sides[1],
            sides[2],
            low[0],
            low[1],
            low[2],
            self.area_m2,
        );
        for warning in &self.warnings {
            text.push_str("\n  warning: ");
            text.push_str(warning);
        }
        text
    }
}

/// Returns the one other unit in which a mesh of an implausible size would be an object.
fn suspected_unit(diameter_m: f64, unit: LengthUnit) -> Option<LengthUnit> {
    if PLAUSIBLE_METERS.contains(&diameter_m) {
        return None;
    }
    let units = [
        LengthUnit::Millimeters,
        LengthUnit::Meters,
        LengthUnit::Centimeters,
    ];
    let in_file = diameter_m / unit.meters_per_unit();
    units.into_iter().find(|other| {
        *other != unit && PLAUSIBLE_METERS.contains(&(in_file * other.meters_per_unit()))
    })
}
