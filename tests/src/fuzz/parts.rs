//! Pipeline files made from arbitrary bytes and the catalog of parts.

use hybrid_icp::pipeline::{Accepts, Catalog, Parameter, Part, PartKind};

use super::bytes::Bytes;

/// Depth below which parts contain no parts of their own kind. TOML files have a nesting limit.
const DEEPEST: usize = 3;

/// Returns a pipeline file of existing parts, with most values in their ranges.
///
/// Counts are small, so that a run ends soon.
pub(super) fn pipeline(bytes: &mut Bytes<'_>) -> String {
    let part = choose(bytes, PartKind::Stage, 0);
    fields(bytes, part, 0).join("\n")
}

fn choose(bytes: &mut Bytes<'_>, kind: PartKind, depth: usize) -> &'static Part {
    let holds_its_kind = |part: &Part| {
        part.parameters.iter().any(|p| match p.accepts {
            Accepts::Part { kind: held, .. } | Accepts::Parts { kind: held, .. } => held == kind,
            _ => false,
        })
    };
    // A target must be deterministic, and the time limit depends on a clock.
    let choices: Vec<&Part> = Catalog::built_in()
        .parts()
        .filter(|part| part.kind == kind && part.name != "time-limit")
        .filter(|part| depth < DEEPEST || !holds_its_kind(part))
        .collect();
    bytes.pick(&choices)
}

fn fields(bytes: &mut Bytes<'_>, part: &Part, depth: usize) -> Vec<String> {
    let mut fields = vec![format!("type = \"{}\"", part.name)];
    for parameter in &part.parameters {
        // Counts are always set, because their defaults favor accuracy over speed.
        let is_count = matches!(parameter.accepts, Accepts::Count { .. });
        if must_be_given(parameter) || is_count || bytes.one_in(2) {
            let value = value(bytes, &parameter.accepts, depth);
            fields.push(format!("{} = {value}", parameter.name));
        }
    }
    fields
}

fn must_be_given(parameter: &Parameter) -> bool {
    matches!(
        parameter.accepts,
        Accepts::Number { default: None, .. }
            | Accepts::Count { default: None, .. }
            | Accepts::NumberList
            | Accepts::Part { default: None, .. }
            | Accepts::Parts { default: None, .. }
    )
}

fn value(bytes: &mut Bytes<'_>, accepts: &Accepts, depth: usize) -> String {
    match accepts {
        Accepts::Number { min, max, .. } => number(bytes, *min, *max),
        Accepts::Count { min, .. } => count(bytes, *min).to_string(),
        Accepts::Flag { .. } => bytes.one_in(2).to_string(),
        Accepts::Word { words } => format!("\"{}\"", bytes.pick(words)),
        Accepts::NumberList => list(bytes, |b| number(b, 0.0, f64::INFINITY)),
        Accepts::Flags { count } => {
            let flags: Vec<String> = (0..*count).map(|_| bytes.one_in(2).to_string()).collect();
            format!("[{}]", flags.join(", "))
        }
        Accepts::Part { kind, .. } => inline(bytes, *kind, depth + 1),
        Accepts::Parts { kind, .. } => list(bytes, |b| inline(b, *kind, depth + 1)),
    }
}

fn inline(bytes: &mut Bytes<'_>, kind: PartKind, depth: usize) -> String {
    let part = choose(bytes, kind, depth);
    format!("{{ {} }}", fields(bytes, part, depth).join(", "))
}

fn list(bytes: &mut Bytes<'_>, mut item: impl FnMut(&mut Bytes<'_>) -> String) -> String {
    let items: Vec<String> = (0..=bytes.below(3)).map(|_| item(bytes)).collect();
    format!("[{}]", items.join(", "))
}

/// Returns a small count, and occasionally one that must be refused or bounded.
fn count(bytes: &mut Bytes<'_>, min: u32) -> u32 {
    match bytes.byte() {
        255 => u32::MAX,
        254 => 1_000_000,
        253 => 10_000,
        byte => min + u32::from(byte % 4),
    }
}

/// Returns an end of the range, a common value, or a value in the range.
fn number(bytes: &mut Bytes<'_>, min: f64, max: f64) -> String {
    let usual = [min, max, 0.1, 0.01, 1e-3, 1.0, 10.0, 90.0, 1e-9, 1e9];
    let value = if bytes.one_in(4) {
        let (low, high) = (min.max(-1e3), max.min(1e3));
        low + bytes.signed().abs() * (high - low)
    } else {
        bytes.pick(&usual)
    };
    // Always has a decimal point or an exponent, because TOML distinguishes integers from floats.
    match value {
        v if v.is_infinite() => if v > 0.0 { "inf" } else { "-inf" }.to_owned(),
        v => format!("{v:e}"),
    }
}
