//! `hybrid-icp inspect`.

use std::path::PathBuf;

use clap::Args;
use hicp_bop::chain;
use hicp_io::{LengthUnit, MeshFile};
use hybrid_icp::core::internal::bounds;
use hybrid_icp::core::{Facing, MeshSurvey, Model, SurfaceColor};
use serde::Serialize;

use crate::limits::limits;
use crate::terminal::say;

/// Describe a mesh file: counts, size, whether it is closed, colors, and warnings.
///
/// Polygons are counted as the triangles that they are cut into. With --json, the keys include
/// triangles, vertices, diameter_m, closed, color (vertices, textures or none, for --rgb of
/// `refine`), and warnings (a list of sentences, empty if nothing looks wrong). The exit code is 0
/// if the file can be read, with or without warnings. Otherwise it is 1, and a message names the
/// place of the error.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  hybrid-icp inspect mug.ply --unit mm")]
pub(crate) struct Arguments {
    /// The mesh: GLB, glTF, OBJ, OFF, PLY or STL.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Unit of the mesh's coordinates: m, mm or cm.
    #[arg(long, value_name = "UNIT", default_value_t = LengthUnit::Meters)]
    unit: LengthUnit,
    /// Write JSON instead of text.
    #[arg(long)]
    json: bool,
}

/// Plausible diameters of an object in meters.
const PLAUSIBLE_METERS: std::ops::RangeInclusive<f64> = 0.005..=5.0;

/// Steps of the coordinates above this share of the diameter are too coarse.
const COARSE: f64 = 1e-4;

#[derive(Debug, Serialize)]
struct Report {
    file: String,
    unit: String,
    triangles: usize,
    vertices: usize,
    diameter_m: f64,
    /// `true` if every edge has exactly two triangles.
    closed: bool,
    /// `vertices`, `textures` or `none`.
    color: &'static str,
    warnings: Vec<String>,
    bounding_box_m: [[f32; 3]; 2],
    area_m2: f64,
    /// `outward`, `inward`, or `unknown` if the mesh does not show it.
    facing: &'static str,
    consistently_wound: bool,
    components: usize,
    boundary_edges: usize,
    non_manifold_edges: usize,
    degenerate_triangles: usize,
    duplicate_triangles: usize,
    unused_vertices: usize,
    /// If the given unit does not give the mesh a plausible size, the unit that does.
    suspected_unit: Option<String>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let file = limits().read_mesh_file(&arguments.file, arguments.unit)?;
    let report = Report::of(arguments, file);
    if arguments.json {
        return say(serde_json::to_string_pretty(&report)?);
    }
    say(report.text())
}

impl Report {
    fn of(arguments: &Arguments, MeshFile { mesh, color_fault }: MeshFile) -> Self {
        let survey = mesh.survey();
        let (facing, step) = (mesh.facing(), mesh.coordinate_step());
        let model = Model::new(mesh);
        let (mesh, diameter_m) = (model.mesh(), model.diameter());
        let bounds = bounds(mesh.used_points()).unwrap_or_default();
        let suspected = suspected_unit(diameter_m, arguments.unit);
        let mut report = Self {
            file: arguments.file.display().to_string(),
            unit: arguments.unit.to_string(),
            triangles: mesh.triangles().len(),
            vertices: mesh.vertices().len(),
            diameter_m,
            closed: survey.is_watertight(),
            color: match mesh.color() {
                Some(SurfaceColor::Vertices(_)) => "vertices",
                Some(_) => "textures",
                None => "none",
            },
            warnings: Vec::new(),
            bounding_box_m: bounds.map(|corner| corner.coords.into()),
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
        let unusable = color_fault.map(|fault| format!("colors cannot be used: {}", chain(&fault)));
        report.warnings.extend(unusable);
        report
    }

    /// Returns warnings as sentences.
    fn warnings(&self, survey: &MeshSurvey, step: f64) -> Vec<String> {
        let mut warnings = Vec::new();
        let (diameter, unit) = (self.diameter_m, &self.unit);
        let (least, most) = (*PLAUSIBLE_METERS.start(), *PLAUSIBLE_METERS.end());
        if !PLAUSIBLE_METERS.contains(&diameter) {
            let suspected = self.suspected_unit.as_ref();
            let hint = suspected.map(|unit| format!("; in {unit} its size would be plausible"));
            let hint = hint.unwrap_or_default();
            warnings.push(format!(
                "the diameter with --unit {unit} is {diameter:.4e} m, expected {least} to {most} m{hint}"
            ));
        }
        if step > COARSE * diameter {
            warnings.push(format!(
                "the coordinates are rounded to steps of {step:.1e} m, because they are far from the origin: move the mesh to the origin"
            ));
        }
        let wound = "normals cannot be trusted: edges whose triangles have opposite winding";
        let open = "the surface is open: edges with only one triangle";
        let counts = [
            (survey.boundary_edges, open),
            (
                survey.non_manifold_edges,
                "edges with more than two triangles",
            ),
            (survey.misoriented_edges, wound),
            (survey.degenerate_triangles, "triangles without area"),
            (survey.duplicate_triangles, "duplicate triangles"),
            (survey.unused_vertices, "vertices without a triangle"),
        ];
        let found = counts.iter().filter(|(count, _)| *count > 0);
        warnings.extend(found.map(|(count, what)| format!("{what}: {count}")));
        if self.facing == "inward" {
            let text = "the triangles are clockwise seen from outside: normals point inward";
            warnings.push(text.to_owned());
        }
        warnings
    }

    fn text(&self) -> String {
        let Self {
            file,
            triangles,
            vertices,
            components,
            facing,
            diameter_m,
            area_m2,
            bounding_box_m: [[left, top, near], [right, bottom, far]],
            ..
        } = self;
        let closed = if self.closed { "closed" } else { "open" };
        let color = match self.color {
            "none" => "no colors",
            "vertices" => "vertex colors",
            textures => textures,
        };
        let parts = if *components == 1 { "part" } else { "parts" };
        let [x, y, z] = [right - left, bottom - top, far - near];
        let mut text = format!(
            "{file}: {triangles} triangles, {vertices} vertices, {components} {parts}, {closed}, facing {facing}, {color}\n  \
             diameter {diameter_m:.6} m, box {x:.6} x {y:.6} x {z:.6} m from ({left}, {top}, {near}), area {area_m2:.6} m2"
        );
        for warning in &self.warnings {
            text.push_str("\n  warning: ");
            text.push_str(warning);
        }
        text
    }
}

/// Returns another unit in which a mesh of an implausible size has a plausible one.
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
