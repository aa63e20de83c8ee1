//! Intervals of average recalls.

use hicp_experiments::{REPLICATES, quantile};
use rand::RngExt as _;

/// Returns the mean of some recalls with its 95 % interval; `None` for fewer than two images.
///
/// `images` has the sum of the recalls of each image, and their number. The interval is that of the
/// bootstrap over images, which are always drawn the same: intervals of differences are paired.
/// With few images, it is too narrow.
pub(super) fn interval(images: &[(f64, usize)]) -> Option<[f64; 3]> {
    if images.len() < 2 {
        return None;
    }
    let mean = |drawn: &mut dyn Iterator<Item = usize>| {
        let drawn = drawn.map(|image| images[image]);
        let (sum, count) = drawn.fold((0.0, 0), |(sum, count), (s, n)| (sum + s, count + n));
        sum / count.max(1) as f64
    };
    let mut rng = hicp_sim::rng(0);
    let means = (0..REPLICATES)
        .map(|_| mean(&mut (0..images.len()).map(|_| rng.random_range(0..images.len()))));
    let mut means: Vec<f64> = means.collect();
    means.sort_by(f64::total_cmp);
    let all = mean(&mut (0..images.len()));
    Some([all, quantile(&means, 0.025)?, quantile(&means, 0.975)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_narrows_with_the_number_of_images() {
        assert_eq!(interval(&[(1.0, 2)]), None);
        assert_eq!(interval(&[(1.0, 2); 9]), Some([0.5; 3]));
        let of = |n: usize| {
            let images: Vec<_> = (0..n).map(|image| ((image % 2) as f64, 1)).collect();
            interval(&images).unwrap()
        };
        let ([few, from, to], [many, low, high]) = (of(10), of(1000));
        assert_eq!((few, many), (0.5, 0.5));
        // The standard error of the mean is 0.5 / √n.
        assert!((to - from - 0.62).abs() < 0.1 && (high - low - 0.062).abs() < 0.01);
    }
}
