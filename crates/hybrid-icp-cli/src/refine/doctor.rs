//! `hybrid-icp doctor`.

use std::path::PathBuf;

use clap::Args;
use clap::error::ErrorKind;
use hicp_io::{LengthUnit, MaskRule};
use hybrid_icp::core::{Isometry3, Model, Observation};
use hybrid_icp::{Diagnosis, Fault, Preset, Refiner};
use serde_json::{Value, json};

use super::inputs::{Inputs, Read};
use super::warnings::about_inputs;
use crate::limits::limits;
use crate::outputs::{Files, write_json};
use crate::terminal::{check_stdout, say, say_beside, warn};

/// Name what is wrong with the inputs of a refinement, and the fix.
///
/// Each fault that inputs can have is corrected on trial, and a short refinement scores the
/// corrected inputs: 0 is perfect, 1 the worst. A fault is named if its correction improves the
/// score clearly. The most probable fault comes first. The faults: wrong units, scales and sizes
/// (with the factor), ray distances, inverted depth, disparities, intrinsics of another resolution
/// or order, a transposed or inverted pose, OpenGL axes, a quaternion of another order, a model
/// with another origin, mirrored images, depth and mask that are not aligned, an inside-out mesh,
/// and masks that are inverted, empty, soft, label images, too large, or on a plane.
///
/// With --json, the keys are faults (a list of objects with fault, problem, fix, option, score and
/// numbers), score (of the inputs as they are) and warnings. The exit code is 0 if the files can be
/// read, with or without faults.
#[derive(Debug, Args)]
#[command(override_usage = USAGE, after_help = EXAMPLE)]
#[command(mut_arg("bbox", |bbox| bbox.hide(true)))]
pub(crate) struct Arguments {
    #[command(flatten)]
    inputs: Inputs,
    /// Write JSON instead of text.
    #[arg(long)]
    json: bool,
    /// A file for the JSON.
    #[arg(long, value_name = "FILE")]
    output: Option<PathBuf>,
}

const USAGE: &str = "\
hybrid-icp doctor --model <FILE> --model-unit <UNIT>
           --depth <FILE> [--depth-scale <MM_PER_UNIT>]
           --mask <FILE> --camera <FILE> --init <FILE> [OPTIONS]";

const EXAMPLE: &str = "\
Examples:
  hybrid-icp doctor --model mug.ply --model-unit mm \\
      --depth depth.png --depth-scale 0.1 --mask mask.png \\
      --camera camera.json --init pose.json
  hybrid-icp doctor --model mug.ply --model-unit m \\
      --depth depth.png --depth-scale 0.1 --mask mask.png \\
      --camera camera.json --init pose.json --json

`hybrid-icp help refine` shows the forms of camera.json and pose.json.";

/// Least part of the mask that must be measured; depths beyond 1 km count as missing.
const MEASURED: f64 = 0.5;
/// Most values of a label image.
const MOST_LABELS: usize = 24;
/// Improvement of the MVE by which a threshold must be better than a label.
const CLEAR: f64 = 0.03;

/// A fault as it is printed.
struct Named {
    /// The name and the numbers.
    fault: Value,
    problem: String,
    fix: String,
    option: Option<String>,
    score: Option<f64>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut inputs = arguments.inputs.clone();
    let unit = inputs.files.object.unit()?;
    if inputs.region.mask.is_none() {
        let text = "--mask <FILE> is missing, expected the mask of the object alone: in a box, other objects hide the fault\n";
        return Err(clap::Error::raw(ErrorKind::MissingRequiredArgument, text).into());
    }
    let mut outputs = Files::default().writes("--output", &arguments.output);
    for (option, path) in inputs.files() {
        outputs = outputs.reads(option, [path]);
    }
    outputs.check()?;
    if arguments.output.is_none() {
        check_stdout()?;
    }
    let mut read = inputs.read()?;
    let (scale, mut factor) = (read.depth_scale, 1.0);
    if measured(&read) < MEASURED {
        // The values may be below 1 km in another unit.
        let before = measured(&read);
        inputs.files.depth_scale = Some(scale / 1000.0);
        let smaller = inputs.read()?;
        if measured(&smaller) > before + MEASURED {
            (read, factor) = (smaller, 1e-3);
        }
    }
    let Read {
        model,
        depth,
        mask,
        color,
        camera,
        init,
        depth_scale,
        mut warnings,
    } = read;
    let init = init.unwrap_or_else(|| unreachable!("--init is required"));
    let init = init.camera_from_object;
    let mut observation = inputs.observe(depth, mask, color, camera)?;
    let mut faults = Vec::new();
    // Other warnings say nothing about the values of the mask.
    let mask = inputs.mask_name();
    if warnings.iter().any(|warning| warning.starts_with(&mask))
        && let Some((named, selected)) = many_values(&inputs, &model, &observation, &init)?
    {
        observation = selected;
        faults.push(named);
    }
    let of_inputs = about_inputs(&model, &observation, &init, &inputs, depth_scale, "")?;
    warnings.extend(of_inputs);
    let diagnosis = Diagnosis::of(&model, &observation, &init);
    let mut found: Vec<(Fault, Option<f64>)> = diagnosis
        .findings
        .iter()
        .map(|finding| (finding.fault, finding.score))
        .collect();
    if factor != 1.0 {
        let scales = |(fault, _): &(Fault, _)| matches!(fault, Fault::DepthScale { .. });
        match found.iter_mut().find(|fault| scales(fault)) {
            Some((Fault::DepthScale { factor: found }, _)) => *found *= factor,
            _ => found.insert(0, (Fault::DepthScale { factor }, Some(diagnosis.score))),
        }
    }
    faults.extend(found.into_iter().map(|(fault, score)| Named {
        fault: json!(fault),
        problem: fault.to_string(),
        fix: match (&fault, &inputs.files.camera_from_depth) {
            (Fault::Misaligned { .. }, Some(path)) => format!(
                "check {}: expected the pose of the depth camera in the frame of --camera, not its inverse",
                path.display()
            ),
            _ => fault.fix(),
        },
        option: option(&fault, unit, scale),
        score,
    }));
    let json = json!({
        "faults": faults.iter().map(Named::json).collect::<Vec<_>>(),
        "score": diagnosis.score,
        "warnings": warnings,
    });
    match &arguments.output {
        Some(path) => write_json(path, &json)?,
        None if arguments.json => return say(serde_json::to_string_pretty(&json)?),
        None => {}
    }
    warnings.iter().for_each(warn);
    say_beside(
        &[arguments.output.as_deref()],
        text(&faults, diagnosis.score),
    )
}

impl Named {
    fn json(&self) -> Value {
        let mut object = self.fault.clone();
        object["problem"] = json!(self.problem);
        object["fix"] = json!(self.fix);
        object["option"] = json!(self.option);
        object["score"] = json!(self.score);
        object
    }
}

/// Returns the faults as lines.
fn text(faults: &[Named], score: f64) -> String {
    let Some(first) = faults.first() else {
        let judged = match score {
            good if good < 0.3 => "the model at the pose explains the image",
            _ => {
                "the model at the pose does not explain the image. It may be another model, or the \
                 mask of another object: check --overlay of refine"
            }
        };
        return format!("no fault found (score {score:.3}): {judged}");
    };
    let mut text = String::new();
    for fault in faults {
        let is_first = std::ptr::eq(fault, first);
        let rank = if is_first { "fault" } else { "\nless probable" };
        text += &format!("{rank}: {}", fault.problem);
        if let Some(corrected) = fault.score {
            text +=
                &format!("\n  evidence: score {score:.3}, corrected {corrected:.3} (0 is perfect)");
        }
        text += &format!("\n  fix: {}", fault.fix);
        if let Some(option) = &fault.option {
            text += &format!("\n  option: {option}");
        }
    }
    text
}

/// Returns the measured share of the mask; 1 for an empty mask.
fn measured(read: &Read) -> f64 {
    let pixels = read.depth.pixels().iter().zip(read.mask.pixels());
    let inside: Vec<bool> = pixels
        .filter(|(_, set)| **set)
        .map(|(z, _)| *z > 0.0)
        .collect();
    match inside.len() {
        0 => 1.0,
        n => inside.iter().filter(|measured| **measured).count() as f64 / n as f64,
    }
}

/// Returns the option that corrects a fault, if there is one.
fn option(fault: &Fault, unit: LengthUnit, depth_scale: f64) -> Option<String> {
    use LengthUnit::{Centimeters, Meters, Millimeters};
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-3;
    match fault {
        Fault::MeshScale { factor } => {
            let meters = unit.meters_per_unit() * factor;
            let units = [Meters, Centimeters, Millimeters];
            let unit = units
                .into_iter()
                .find(|unit| near(unit.meters_per_unit(), meters))?;
            Some(format!("--model-unit {unit}"))
        }
        Fault::DepthScale { factor } => {
            let scale = format!("{:.4e}", depth_scale * factor)
                .parse::<f64>()
                .ok()?;
            Some(format!("--depth-scale {scale}"))
        }
        // The factor leads from one of the three units to another.
        Fault::TranslationScale { factor } => {
            let units = [
                (1000.0, Meters),
                (100.0, Meters),
                (10.0, Centimeters),
                (0.1, Millimeters),
                (0.01, Centimeters),
                (0.001, Millimeters),
            ];
            let (_, unit) = units.into_iter().find(|(other, _)| near(*other, *factor))?;
            Some(format!("--init-unit {unit}"))
        }
        _ => None,
    }
}

/// Selects the object in a mask of many values: by its label, or by a threshold.
///
/// Returns the fault and the observation with that mask. The label is the one that the model at the
/// initial pose explains best.
fn many_values(
    inputs: &Inputs,
    model: &Model,
    observation: &Observation,
    init: &Isometry3<f64>,
) -> anyhow::Result<Option<(Named, Observation)>> {
    let region = &inputs.region;
    let (Some(path), MaskRule::NotZero) = (&region.mask, region.mask_options.rule()) else {
        return Ok(None);
    };
    let read = limits().read_mask(path, MaskRule::NotZero)?;
    let (values, threshold) = (read.values, read.threshold);
    let most = values.last().copied().unwrap_or(0.0);
    let may_be_labels = values.len() <= MOST_LABELS;
    let labels = values
        .iter()
        .filter(|label| may_be_labels && label.fract() == 0.0);
    let mut rules: Vec<MaskRule> = labels.copied().map(MaskRule::Equal).collect();
    if (threshold..MaskRule::COLOR).contains(&most) {
        rules.push(MaskRule::AtLeast(threshold));
    }
    let mut refiner = Refiner::preset(Preset::Local);
    let mut best: Option<(f64, Observation, MaskRule)> = None;
    for rule in rules {
        let mask = limits().read_mask(path, rule)?.mask;
        let depth = observation.shared_depth().clone();
        // With two cameras, the mask's size may be another.
        let Ok(selected) = Observation::new(depth, mask, *observation.camera()) else {
            continue;
        };
        let handicap = match rule {
            MaskRule::Equal(_) => 0.0,
            _ => CLEAR,
        };
        let mve = refiner.mve(model, &selected, init) + handicap;
        if best.as_ref().is_none_or(|(least, ..)| mve < *least) {
            best = Some((mve, selected, rule));
        }
    }
    let Some((_, selected, rule)) = best else {
        return Ok(None);
    };
    let (name, kind, option) = match rule {
        MaskRule::Equal(value) => {
            let option = match value - MaskRule::COLOR {
                color if color >= 0.0 => format!("--mask-value '#{:06x}'", color as u32),
                _ => format!("--mask-value {value}"),
            };
            ("mask_labels", "a label image", option)
        }
        _ => ("mask_soft", "soft", format!("--mask-threshold {threshold}")),
    };
    let (path, n) = (path.display(), values.len());
    let named = Named {
        fault: json!({ "fault": name }),
        problem: format!(
            "{path}: the mask is {kind}: all of its {n} values but 0 count as the object"
        ),
        fix: format!("pass {option}"),
        option: Some(option),
        score: None,
    };
    Ok(Some((named, selected)))
}
