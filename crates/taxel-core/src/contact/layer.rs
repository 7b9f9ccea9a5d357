//! What lies between the foam's upper face, where the ball presses, and its lower one, where the taxels are.

/// From this wave number times the thickness on `e^-x` is 0.
const SHORT: f64 = 1e3;

/// The share of a pressure wave on the upper face of a bonded elastic layer that arrives at its base.
///
/// `x` is the wave number times the thickness. The layer is bonded at its base and pressed without shear above:
/// `T = m (m cosh x + x sinh x) / (m^2 cosh^2 x - (m - 1)^2 sinh^2 x + x^2)` with `m = 2 (1 - nu)`, from the plane
/// strain Airy function `(A cosh + B sinh + C s sinh + D s cosh)`. Long waves arrive whole, short ones not at all:
/// the spatial smoothing of thesis 4.3.1.
#[must_use]
pub fn base_stress(x: f64, poisson: f64) -> f64 {
    let m = 2.0 * (1.0 - poisson);
    // Above and below divided by cosh^2, so that nothing overflows; shorter waves do not arrive either.
    let x = x.min(SHORT);
    let (tanh, one_over_cosh) = (x.tanh(), 1.0 / x.cosh());
    let above = m * (m + x * tanh) * one_over_cosh;
    above / (m * m - (m - 1.0).powi(2) * tanh * tanh + (x * one_over_cosh).powi(2))
}

/// How far a pressure wave on the upper face of a bonded elastic layer pushes that face in, in units of the pressure
/// times the thickness over Young's modulus.
///
/// `x` is the wave number times the thickness. From the same four conditions as [`base_stress`] (no displacement at the
/// base, no shear above): `2 (1 - nu^2) / x (2 k sinh 2x - 4x) / (2 k cosh 2x + 4x^2 + 1 + k^2)` with `k = 3 - 4 nu`
/// (Carbone and Mangialardi 2008). Long waves meet the confined modulus, short ones a half-space.
#[must_use]
pub fn surface_compliance(x: f64, poisson: f64) -> f64 {
    let (k, plane) = (3.0 - 4.0 * poisson, 1.0 - poisson * poisson);
    if x < 1e-4 {
        // Both parts of the fraction vanish; what is left out is of the order of x^2.
        return (1.0 + poisson) * (1.0 - 2.0 * poisson) / (1.0 - poisson);
    }
    // Above and below times e^-2x, so that nothing overflows; of shorter waves both are k.
    let short = x.min(SHORT);
    let decay = (-2.0 * short).exp();
    let above = k * (1.0 - decay * decay) - 4.0 * short * decay;
    let below = k * (1.0 + decay * decay) + (4.0 * short * short + 1.0 + k * k) * decay;
    2.0 * plane / x * above / below
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_of_any_length_have_a_number() {
        for nu in [0.0, 0.3, 0.5] {
            let mut before = (f64::INFINITY, f64::INFINITY);
            for power in -320..=308 {
                let x = format!("1e{power}").parse().unwrap();
                let now = (surface_compliance(x, nu), base_stress(x, nu));
                assert!(now.0 >= 0.0 && now.1 >= 0.0 && now.1 <= before.1 + 1e-12, "{x}: {now:?}, before {before:?}");
                if x > 100.0 {
                    // A half-space.
                    assert!((now.0 * x / (2.0 * (1.0 - nu * nu)) - 1.0).abs() < 1e-9, "{x}: {now:?}");
                }
                before = now;
            }
            assert_eq!((surface_compliance(f64::INFINITY, nu), base_stress(f64::INFINITY, nu)), (0.0, 0.0));
        }
    }

    type Matrix = [[f64; 4]; 4];

    fn times(a: &Matrix, b: &Matrix) -> Matrix {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
    }

    /// exp(a) by scaling, a Taylor series and squaring.
    fn exponential(a: &Matrix) -> Matrix {
        let squarings = 12;
        let small = a.map(|row| row.map(|v| v / f64::powi(2.0, squarings)));
        let mut term: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
        let mut sum = term;
        for n in 1..12 {
            term = times(&term, &small).map(|row| row.map(|v| v / f64::from(n)));
            for i in 0..4 {
                for j in 0..4 {
                    sum[i][j] += term[i][j];
                }
            }
        }
        (0..squarings).fold(sum, |power, _| times(&power, &power))
    }

    /// Base stress and surface displacement under a pressure of 1 from the layer's state equation, plane strain, shear
    /// modulus 1, wave number `x`, thickness 1.
    fn by_state_equation(x: f64, nu: f64) -> (f64, f64) {
        // State (u, w, tau, sigma): displacements along sin and cos, stresses along sin and cos; d/dz = A state.
        let confined = 2.0 * (1.0 - nu) / (1.0 - 2.0 * nu);
        let coupling = nu / (1.0 - nu);
        let plane = 2.0 / (1.0 - nu);
        let a: Matrix = [
            [0.0, x, 1.0, 0.0],
            [-coupling * x, 0.0, 0.0, 1.0 / confined],
            [plane * x * x, 0.0, 0.0, coupling * x],
            [0.0, 0.0, -x, 0.0],
        ];
        let e = exponential(&a);
        // Base: u = w = 0, unknown (tau0, sigma0). Top: tau = 0, sigma = 1.
        let determinant = e[2][2] * e[3][3] - e[2][3] * e[3][2];
        (e[2][2] / determinant, (e[1][3] * e[2][2] - e[1][2] * e[2][3]) / determinant)
    }

    #[test]
    fn the_closed_form_equals_the_state_equation() {
        for nu in [0.0, 0.1, 0.3, 0.45] {
            for x in [1e-3, 0.1, 0.5, 1.0, 2.0, 4.0, 7.0] {
                let (stress, displacement) = by_state_equation(x, nu);
                let closed = base_stress(x, nu);
                assert!((closed - stress).abs() < 1e-7, "nu {nu}, x {x}: {closed} against {stress}");
                // Young's modulus is 2 (1 + nu) of the shear modulus.
                let (closed, oracle) = (surface_compliance(x, nu), 2.0 * (1.0 + nu) * displacement);
                assert!((closed - oracle).abs() < 1e-6, "nu {nu}, x {x}: {closed} against {oracle}");
            }
        }
    }

    #[test]
    fn a_short_wave_meets_a_half_space_and_a_long_one_the_confined_layer() {
        for nu in [0.0_f64, 0.2, 0.45, 0.499] {
            let half_space = 2.0 * (1.0 - nu * nu) / 50.0;
            assert!((surface_compliance(50.0, nu) / half_space - 1.0).abs() < 1e-12);
            let confined = (1.0 + nu) * (1.0 - 2.0 * nu) / (1.0 - nu);
            assert!((surface_compliance(2e-4, nu) - confined).abs() < 1e-6, "nu {nu}");
            assert!((surface_compliance(0.0, nu) - confined).abs() < 1e-15);
            assert!(surface_compliance(900.0, nu) > 0.0);
        }
    }

    #[test]
    fn long_waves_arrive_whole_and_short_ones_vanish() {
        assert!((base_stress(0.0, 0.0) - 1.0).abs() < 1e-12);
        assert!(base_stress(15.0, 0.0) < 1e-4);
        assert!(base_stress(800.0, 0.3).abs() < 1e-300);
    }
}
