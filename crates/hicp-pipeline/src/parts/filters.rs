//! Outlier filters and weights.

use hicp_association::{
    BoundaryTargets, ConstantWeight, DistanceWeight, MadDistance, MaxDistance, MaxNormalAngle,
    MedianDistance, MinPairs, NormalWeight, OneToOne, Schedule, SensorNoise, SensorNoiseWeight,
    Trimmed, VarTrimmed,
};

use super::common::{EDGE, TILT, length};
use crate::catalog::{BoxedFilter, Catalog};
use crate::range::{FACTOR, METERS, Range, SHARE};

pub(super) fn add(catalog: &mut Catalog) {
    catalog.add_filter("max-distance", |p| {
        p.about = "Removes pairs farther apart than τ_max. Source: §III-A.1; Turk & Levoy 1994. \
            Cost: O(n).";
        Ok(MaxDistance(length(p, "limit", 0.25, "τ_max")?))
    });
    catalog.add_filter("max-normal-angle", |p| {
        p.about = "Removes pairs whose normals differ by more than θ_max. Source: §III-A.1; Pulli \
            1999. Cost: O(n).";
        let angle = Range::new(0.0, 180.0, "degrees");
        Ok(MaxNormalAngle::degrees(
            p.number("degrees", angle, 90.0, "θ_max")?,
        ))
    });
    catalog.add_filter("median-distance", |p| {
        p.about = "Removes pairs farther apart than a multiple of the median. Source: Diebel et \
            al. 2004. Cost: O(n).";
        Ok(MedianDistance::new(p.number(
            "factor",
            FACTOR,
            3.0,
            "times the median",
        )?))
    });
    catalog.add_filter("mad-distance", |p| {
        p.about = "Removes pairs farther apart than the median by a multiple of the median \
            absolute deviation (MAD). Cost: O(n).";
        let factor = p.number("factor", FACTOR, 3.0, "multiple of 1.4826 MAD")?;
        let floor = p.number("floor_meters", METERS, 0.001, "least deviation that counts")?;
        Ok(MadDistance::new(factor, floor))
    });
    catalog.add_filter("trimmed", |p| {
        p.about = "Keeps a share of the pairs, the closest. Source: Chetverikov et al. 2002. \
            Cost: O(n).";
        Ok(Trimmed::new(p.number(
            "keep",
            SHARE,
            0.85,
            "share of the pairs to keep",
        )?))
    });
    catalog.add_filter("var-trimmed", |p| {
        p.about = "Keeps the share of the pairs with the least fractional RMSD. Source: Phillips, \
            Liu & Tomasi 2007. Cost: O(n log n).";
        let least = p.number("min_keep", SHARE, 0.05, "smallest share to keep")?;
        let most = p.number("max_keep", SHARE, 0.99, "largest share to keep")?;
        if least > most {
            return Err(p.refuse("min_keep", format!("at most max_keep, {most}")));
        }
        let lambda = p.number("lambda", FACTOR, 0.95, "exponent of the share")?;
        Ok(VarTrimmed::new(least, most, lambda))
    });
    catalog.add_filter("one-to-one", |p| {
        p.about = "Keeps for every observed point the closest of its pairs. Cost: O(n log n).";
        Ok(OneToOne::default())
    });
    catalog.add_filter("boundary-targets", |p| {
        p.about = "Removes pairs whose observed point is at the mask's or a depth edge. \
            Source: Turk & Levoy 1994. Cost: O(n).";
        Ok(BoundaryTargets {
            width: p.count("width", 0, 1, "pixels from the boundary")?,
            max_tilt_degrees: p.number("max_tilt_degrees", TILT, 85.0, EDGE)?,
        })
    });
    catalog.add_filter("min-pairs", |p| {
        p.about = "Removes all pairs if there are fewer than a number. Cost: O(1).";
        Ok(MinPairs {
            count: p.count("count", 0, 6, "smallest number of pairs to keep")?,
        })
    });
    catalog.add_filter("constant-weight", |p| {
        p.about = "Multiplies weights by a number. Cost: O(n).";
        Ok(ConstantWeight {
            weight: p.number("weight", FACTOR, 1.0, "factor of the weights")?,
        })
    });
    catalog.add_filter("distance-weight", |p| {
        p.about = "Multiplies weights by 1 − distance/max. Source: Godin et al. 1994. Cost: O(n).";
        Ok(DistanceWeight {
            max: length(p, "max", 0.25, "distance of weight 0")?,
        })
    });
    catalog.add_filter("normal-weight", |p| {
        p.about = "Multiplies weights by the cosine between the normals. Source: Rusinkiewicz & \
            Levoy 2001. Cost: O(n).";
        Ok(NormalWeight)
    });
    catalog.add_filter("sensor-noise-weight", |p| {
        p.about = "Multiplies weights by the inverse variance of the sensor at the point's depth \
            and tilt. Source: Ahn et al. 2019 as transcribed in public code, axial term. \
            Cost: O(n).";
        let per_meter = Range::positive("1/m");
        Ok(SensorNoiseWeight {
            noise: SensorNoise {
                constant: p.number("constant", METERS, 0.001_063, "deviation at depth 0")?,
                linear: p.number(
                    "linear",
                    FACTOR,
                    0.000_727_8,
                    "deviation per meter of depth",
                )?,
                quadratic: p.number(
                    "quadratic",
                    per_meter,
                    0.003_949,
                    "deviation per m² of squared depth",
                )?,
                tilt: p.number("tilt", FACTOR, 0.0, "factor of the tilt term")?,
            },
        })
    });
    catalog.add_filter("schedule", |p| {
        p.about = "Applies one filter per iteration, the last from then on. The \
            divergence rule of the default stop ends a schedule that removes more and more pairs; \
            use convergence and iteration-limit instead. Cost: that of the filter.";
        Ok(Schedule::new(p.parts::<BoxedFilter>(
            "filters",
            None,
            "the filters, by iteration",
        )?))
    });
}
