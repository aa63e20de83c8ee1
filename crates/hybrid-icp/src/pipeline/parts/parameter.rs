//! Parameters, as the entries of the catalogue write them.

use super::super::catalog::{Accepts, Parameter, PartKind};

pub(super) const fn number(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    (min, max): (f64, f64),
    default: Option<f64>,
) -> Parameter {
    Parameter {
        name,
        unit,
        meaning,
        accepts: Accepts::Number { min, max, default },
    }
}

pub(super) const fn count(
    name: &'static str,
    meaning: &'static str,
    min: u32,
    default: Option<u32>,
) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Count { min, default },
    }
}

pub(super) const fn word(
    name: &'static str,
    meaning: &'static str,
    words: &'static [&'static str],
    default: &'static str,
) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Word { words, default },
    }
}

pub(super) const fn part(
    name: &'static str,
    meaning: &'static str,
    kind: PartKind,
    default: Option<&'static str>,
) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Part { kind, default },
    }
}

pub(super) const fn parts(
    name: &'static str,
    meaning: &'static str,
    kind: PartKind,
    default: Option<&'static [&'static str]>,
) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Parts { kind, default },
    }
}

pub(super) const fn flag(name: &'static str, meaning: &'static str, default: bool) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Flag { default },
    }
}

pub(super) const fn flags(name: &'static str, meaning: &'static str, count: usize) -> Parameter {
    Parameter {
        name,
        unit: "",
        meaning,
        accepts: Accepts::Flags { count },
    }
}

/// What a length may count in.
pub(super) const LENGTH_UNITS: &[&str] = &["diameters", "meters"];
pub(super) const INFINITE: f64 = f64::INFINITY;
pub(super) const POSITIVE: (f64, f64) = (0.0, INFINITE);

/// How many points a selection keeps of a pixel grid; [`SPACING`] follows it.
pub(super) const KEPT: Parameter = count(
    "points",
    "about how many points are kept, on a pixel grid",
    1,
    Some(2000),
);
/// How many observed points a search goes through; [`SPACING`] follows it.
pub(super) const SEARCHED: Parameter = count(
    "points",
    "about how many observed points are searched, on a pixel grid",
    1,
    Some(4000),
);
/// How many observed points ask for a pair; [`SPACING`] follows it.
pub(super) const ASKING: Parameter = count(
    "points",
    "about how many observed points ask, on a pixel grid",
    1,
    Some(2000),
);
/// The spacing of a pixel grid, where a count of points is not what is wanted.
pub(super) const SPACING: Parameter = count(
    "pixels",
    "or the spacing of the grid; 0 leaves it to `points`",
    0,
    Some(0),
);
/// The same for what looks at every pixel unless told otherwise.
pub(super) const EVERY_PIXEL: Parameter = count(
    "pixels",
    "the spacing of the grid; 0 leaves it to `points`",
    0,
    Some(1),
);
