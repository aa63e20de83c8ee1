//! Independent streams of random numbers from one seed.

use rand::SeedableRng;

use crate::SimRng;

/// Creates the random generator for one purpose, identified by a seed, labels and an index.
///
/// Streams are independent of each other. A step (the pose, the perturbation, the noise) can be
/// changed, repeated or left out without changing the numbers of other steps. Cases can be
/// generated in any order and on any number of threads. The numbers are the same on every machine
/// and in every version.
///
/// ```
/// use rand::Rng;
/// use hicp_sim::stream;
/// let mut noise_of_case_3 = stream(1, &["mug", "noise"], 3);
/// assert_eq!(noise_of_case_3.next_u64(), stream(1, &["mug", "noise"], 3).next_u64());
/// assert_ne!(stream(1, &["mug", "pose"], 3).next_u64(), stream(1, &["mug", "noise"], 3).next_u64());
/// ```
#[must_use]
pub fn stream(seed: u64, labels: &[&str], index: u64) -> SimRng {
    let mut state = mix(seed);
    for label in labels {
        // FNV-1a of the bytes. Adding the length distinguishes ("ab", "c") from ("a", "bc").
        let hash = label.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        state = mix(state ^ hash.wrapping_add(label.len() as u64));
    }
    SimRng::seed_from_u64(mix(state ^ mix(index)))
}

/// Mixes bits with the finalizer of `SplitMix64` (Steele, Lea & Flood 2014).
///
/// On average, every input bit changes half of the output bits.
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
