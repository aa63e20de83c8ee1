//! Robust kernels: the influence of a residual by its size.

/// A robust loss ρ(x) of a residual x = r/σ, with its weight for iteratively reweighted least
/// squares.
///
/// [`Kernel`] has the usual ones. Implement this trait for a custom kernel.
///
/// ```
/// use hicp_metric::{PointToPlane, Robust, RobustKernel, Scale};
///
/// /// Student's t with ν degrees of freedom, scaled so that w(0) = 1.
/// #[derive(Clone, Copy, Debug)]
/// struct StudentT(f64);
///
/// impl RobustKernel for StudentT {
///     fn weight(&self, x: f64) -> f64 {
///         self.0 / (self.0 + x * x)
///     }
///
///     fn loss(&self, x: f64) -> f64 {
///         0.5 * self.0 * (x * x / self.0).ln_1p()
///     }
/// }
///
/// let metric = Robust::new(PointToPlane, StudentT(5.0), Scale::default());
/// // Or chosen at run time.
/// let kernel: Box<dyn RobustKernel> = Box::new(StudentT(5.0));
/// let metric = Robust::new(PointToPlane, kernel, Scale::default());
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a robust kernel",
    label = "this must implement `RobustKernel`",
    note = "`Robust::kernel` accepts a `Kernel` or any type with `weight` and `loss`"
)]
pub trait RobustKernel {
    /// Returns the weight w(x) = ρ′(x)/x, where x = r/σ has no unit.
    ///
    /// It must be even and at most 1, with w(0) = 1, and must not increase with |x|.
    fn weight(&self, x: f64) -> f64;

    /// Returns the loss ρ(x), with ρ(0) = 0 and ρ(x) ≈ x²/2 near zero.
    fn loss(&self, x: f64) -> f64;
}

macro_rules! forward {
    ($($pointer:ty),+) => {$(
        impl<T: RobustKernel + ?Sized> RobustKernel for $pointer {
            fn weight(&self, x: f64) -> f64 {
                (**self).weight(x)
            }

            fn loss(&self, x: f64) -> f64 {
                (**self).loss(x)
            }
        }
    )+};
}

forward!(Box<T>, &T);

impl RobustKernel for Kernel {
    #[inline]
    fn weight(&self, x: f64) -> f64 {
        Kernel::weight(self, x)
    }

    #[inline]
    fn loss(&self, x: f64) -> f64 {
        Kernel::loss(self, x)
    }
}

/// Smallest tuning constant: the square of a smaller one would overflow.
const MIN_CONSTANT: f64 = 1e-9;

/// The usual robust losses ρ(x) of a residual x = r/σ, with their weights w(x) = ρ′(x)/x.
///
/// All use the same parametrization. Near zero ρ(x) ≈ x²/2, so w(0) = 1; w is even, finite and does
/// not increase with |x|. The tuning constant is in units of σ. The named constants have 95 %
/// efficiency for Gaussian residuals (Holland & Welsch 1977; Zhang 1997). Other libraries use
/// "Cauchy" and "Geman–McClure" with different constants and widths.
///
/// Convex kernels (`L2`, `Huber`, `Fair`) have one minimum and a bounded influence. The influence
/// of `Cauchy` decreases for large residuals. `GemanMcClure`, `Welsch` and `Tukey` reject large
/// residuals and therefore need a good initial pose. Constants below 10⁻⁹ count as 10⁻⁹.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Kernel {
    /// ρ = x²/2: no kernel. w = 1.
    L2,
    /// ρ = x²/2 up to k, k|x| − k²/2 beyond (Huber 1964). w = min(1, k/|x|).
    Huber(f64),
    /// ρ = c² (|x|/c − ln(1 + |x|/c)). w = 1/(1 + |x|/c).
    Fair(f64),
    /// ρ = c²/2 ln(1 + (x/c)²), also Lorentzian. w = 1/(1 + (x/c)²).
    Cauchy(f64),
    /// ρ = x²/2 / (1 + (x/c)²), the textbook form (Geman & McClure 1985 with a width).
    ///
    /// w = c⁴/(c² + x²)².
    GemanMcClure(f64),
    /// ρ = c²/2 (1 − exp(−(x/c)²)), also Leclerc. w = exp(−(x/c)²).
    Welsch(f64),
    /// ρ = c²/6 (1 − (1 − (x/c)²)³) up to c, c²/6 beyond (Beaton & Tukey 1974).
    ///
    /// w = (1 − (x/c)²)² up to c, 0 beyond.
    Tukey(f64),
}

impl Kernel {
    /// Huber's kernel with 95 % efficiency, k = 1.345.
    pub const HUBER: Self = Self::Huber(1.345);
    /// The fair kernel with 95 % efficiency, c = 1.3998.
    pub const FAIR: Self = Self::Fair(1.3998);
    /// Cauchy's kernel with 95 % efficiency, c = 2.3849.
    pub const CAUCHY: Self = Self::Cauchy(2.3849);
    /// Geman and McClure's kernel with 95 % efficiency, c = 3.7874.
    pub const GEMAN_MCCLURE: Self = Self::GemanMcClure(3.7874);
    /// Welsch's kernel with 95 % efficiency, c = 2.9846.
    pub const WELSCH: Self = Self::Welsch(2.9846);
    /// Tukey's kernel with 95 % efficiency, c = 4.6851.
    pub const TUKEY: Self = Self::Tukey(4.6851);

    /// Returns the weight w(x) = ρ′(x)/x, in [0, 1], where x = r/σ has no unit.
    ///
    /// ```
    /// use hicp_metric::Kernel;
    /// assert_eq!(Kernel::HUBER.weight(0.0), 1.0);
    /// assert_eq!(Kernel::HUBER.weight(-2.69), 0.5);
    /// assert_eq!(Kernel::TUKEY.weight(5.0), 0.0);
    /// ```
    #[must_use]
    #[inline]
    pub fn weight(&self, x: f64) -> f64 {
        let (c, u) = self.relative(x);
        match self {
            Self::L2 => 1.0,
            Self::Huber(_) if u <= 1.0 => 1.0,
            Self::Huber(_) => c / x.abs(),
            Self::Fair(_) => 1.0 / (1.0 + u),
            Self::Cauchy(_) => 1.0 / (1.0 + u * u),
            Self::GemanMcClure(_) => (1.0 + u * u).powi(2).recip(),
            Self::Welsch(_) => (-u * u).exp(),
            Self::Tukey(_) if u < 1.0 => (1.0 - u * u).powi(2),
            Self::Tukey(_) => 0.0,
        }
    }

    /// Returns the loss ρ(x), at most x²/2.
    #[must_use]
    #[inline]
    pub fn loss(&self, x: f64) -> f64 {
        let (c, u) = self.relative(x);
        let square = u * u;
        match self {
            Self::L2 => 0.5 * x * x,
            Self::Huber(_) if u <= 1.0 => 0.5 * x * x,
            Self::Huber(_) => c * (x.abs() - 0.5 * c),
            // Below 10⁻⁴ the difference cancels, so use its series u²/2 − u³/3 + u⁴/4.
            Self::Fair(_) if u < 1e-4 => c * c * square * (0.5 - u / 3.0 + square / 4.0),
            Self::Fair(_) if u.is_infinite() => u,
            Self::Fair(_) => c * c * (u - u.ln_1p()),
            Self::Cauchy(_) => 0.5 * c * c * square.ln_1p(),
            // The limit if the square overflows.
            Self::GemanMcClure(_) if square.is_infinite() => 0.5 * c * c,
            Self::GemanMcClure(_) => 0.5 * c * c * (square / (1.0 + square)),
            Self::Welsch(_) => -0.5 * c * c * (-square).exp_m1(),
            // 1 − (1 − s)³ without the cancellation.
            Self::Tukey(_) if u < 1.0 => {
                c * c / 6.0 * square * (3.0 - 3.0 * square + square * square)
            }
            Self::Tukey(_) => c * c / 6.0,
        }
    }

    /// Returns the tuning constant, and |x| in its units.
    #[inline]
    fn relative(&self, x: f64) -> (f64, f64) {
        let c = match *self {
            Self::L2 => 1.0,
            Self::Huber(c)
            | Self::Fair(c)
            | Self::Cauchy(c)
            | Self::GemanMcClure(c)
            | Self::Welsch(c)
            | Self::Tukey(c) => c.max(MIN_CONSTANT),
        };
        (c, x.abs() / c)
    }
}

/// Huber's kernel with 95 % efficiency, which is convex and so keeps one minimum far away.
impl Default for Kernel {
    fn default() -> Self {
        Self::HUBER
    }
}
