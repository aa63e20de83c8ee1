//! Loops compiled for the vector units of the current processor.

/// A loop for [`vectorized`]: plain Rust over arrays, which the compiler turns into vector
/// instructions.
///
/// Mark `run` and the functions that it calls `#[inline(always)]`. Otherwise they are compiled for
/// the baseline.
pub trait VectorLoop {
    /// The result of the loop.
    type Output;

    /// Runs the loop.
    fn run(self) -> Self::Output;
}

/// Runs a loop with AVX2 if the processor has it, otherwise as compiled for the baseline.
///
/// The choice is made at run time and does not change the bits. The code is the same, lanes are
/// added in a stated order, and neither version contracts a product and a sum into one rounding.
#[inline]
pub fn vectorized<L: VectorLoop>(vector_loop: L) -> L::Output {
    pulp::Arch::new().dispatch(Adapter(vector_loop))
}

/// Returns its argument. The compiler must store all lanes before it reads single ones.
///
/// Otherwise, a later use of single lanes can make it compute some of them one by one. The bits are
/// the same.
#[inline(always)]
#[must_use]
pub fn stored<const N: usize>(lanes: [f32; N]) -> [f32; N] {
    std::hint::black_box(lanes)
}

struct Adapter<L>(L);

impl<L: VectorLoop> pulp::NullaryFnOnce for Adapter<L> {
    type Output = L::Output;

    #[inline(always)]
    fn call(self) -> L::Output {
        self.0.run()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone)]
    struct Sum([Vec<f64>; 2]);

    impl VectorLoop for Sum {
        type Output = [f64; 4];

        #[inline(always)]
        fn run(self) -> [f64; 4] {
            let mut sums = [0.0; 4];
            let [a, b] = &self.0;
            for (a, b) in a.chunks_exact(4).zip(b.chunks_exact(4)) {
                for lane in 0..4 {
                    sums[lane] += a[lane] * b[lane];
                }
            }
            sums
        }
    }

    /// Fails if a product is not rounded before it is added: half of such sums would differ.
    #[test]
    fn the_bits_are_those_of_the_baseline() {
        let numbers = |seed: f64| (0..4000).map(|i| (seed + f64::from(i)).sin()).collect();
        let sum = Sum([numbers(0.1), numbers(0.7)]);
        assert_eq!(sum.clone().run(), vectorized(sum));
    }
}
