//! What lies between the foam's upper face, where the ball presses, and its lower one, where the taxels are.

/// The share of a pressure wave on the upper face of a bonded elastic layer that arrives at its base.
///
/// `x` is the wave number times the thickness. The layer is bonded at its base and pressed without shear above:
/// `T = m (m cosh x + x sinh x) / (m^2 cosh^2 x - (m - 1)^2 sinh^2 x + x^2)` with `m = 2 (1 - nu)`, from the plane
/// strain Airy function `(A cosh + B sinh + C s sinh + D s cosh)`. Long waves arrive whole, short ones not at all:
/// the spatial smoothing of thesis 4.3.1.
#[must_use]
pub fn base_stress(x: f64, poisson: f64) -> f64 {
    let m = 2.0 * (1.0 - poisson);
    // Above and below divided by cosh^2, so that nothing overflows.
    let (tanh, one_over_cosh) = (x.tanh(), 1.0 / x.cosh());
    let above = m * (m + x * tanh) * one_over_cosh;
    above / (m * m - (m - 1.0).powi(2) * tanh * tanh + (x * one_over_cosh).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// The base stress from the layer's state equation, plane strain, shear modulus 1, wave number `x`, thickness 1.
    fn by_state_equation(x: f64, nu: f64) -> f64 {
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
        e[2][2] / determinant
    }

    #[test]
    fn the_closed_form_equals_the_state_equation() {
        for nu in [0.0, 0.1, 0.3, 0.45] {
            for x in [1e-3, 0.1, 0.5, 1.0, 2.0, 4.0, 7.0] {
                let (closed, oracle) = (base_stress(x, nu), by_state_equation(x, nu));
                assert!((closed - oracle).abs() < 1e-7, "nu {nu}, x {x}: {closed} against {oracle}");
            }
        }
    }

    #[test]
    fn long_waves_arrive_whole_and_short_ones_vanish() {
        assert!((base_stress(0.0, 0.0) - 1.0).abs() < 1e-12);
        assert!(base_stress(15.0, 0.0) < 1e-4);
        assert!(base_stress(800.0, 0.3).abs() < 1e-300);
    }
}
