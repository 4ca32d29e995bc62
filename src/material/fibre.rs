//! The force-stretch law of muscle fibres (Blemker et al. 2005; Wu et al. 2013, Eqs. 6 to 8).
//!
//! With s = lambda / lambda_ofl the energy per reference volume is
//! ```text
//! W(lambda) = sigma_max (a G_act(s) + G_pas(s)),  dG/ds = f,
//! ```
//! so that dW/dlambda = sigma_max f / lambda_ofl and the Cauchy stress along the fibre is
//! sigma_max f lambda / lambda_ofl / J, which is Eq. 8.

/// Constants of the law and what follows from them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blemker {
    /// Maximum isometric stress, kPa.
    pub sigma_max: f64,
    /// Stretch at which the passive force becomes linear.
    pub lambda_star: f64,
    /// Optimal fibre stretch.
    pub lambda_ofl: f64,
    /// Factor of the passive exponential.
    pub p1: f64,
    /// Exponent of the passive exponential.
    pub p2: f64,
}

/// A normalised force f(s), its integral G and its slope.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Force {
    /// G(s), zero at rest.
    pub energy: f64,
    /// f(s) = dG/ds.
    pub force: f64,
    /// df/ds.
    pub slope: f64,
}

/// The published polynomials meet with equal values; the slope jumps by 0.4 at 0.6 and at 1.4.
///
/// f_act(s): 9 (s - 0.4)^2 on (0.4, 0.6]; 1 - 4 (1 - s)^2 on (0.6, 1.4); 9 (s - 1.6)^2 on [1.4, 1.6); else 0 (Eq. 6).
/// G_act is zero for s <= 0.4; it does not depend on the law's constants.
pub fn active(s: f64) -> Force {
    // G at the joins: 9 (0.2)^3 / 3 = 0.024; then s - 4/3 (s - 1)^3 from 0.6 to 1.4
    const AT_06: f64 = 0.024;
    const AT_14: f64 = AT_06 + 0.8 - 8.0 / 3.0 * 0.4 * 0.4 * 0.4;
    const AT_16: f64 = AT_14 + 0.024;
    if s <= 0.4 {
        Force::default()
    } else if s <= 0.6 {
        let d = s - 0.4;
        Force { energy: 3.0 * d * d * d, force: 9.0 * d * d, slope: 18.0 * d }
    } else if s < 1.4 {
        let d = s - 1.0;
        Force {
            energy: AT_06 + (s - 0.6) - 4.0 / 3.0 * (d * d * d + 0.064),
            force: 1.0 - 4.0 * d * d,
            slope: -8.0 * d,
        }
    } else if s < 1.6 {
        let d = s - 1.6;
        Force { energy: AT_16 + 3.0 * d * d * d, force: 9.0 * d * d, slope: 18.0 * d }
    } else {
        Force { energy: AT_16, ..Force::default() }
    }
}

impl Blemker {
    /// f_pas(s): P1 (exp(P2 (s - 1)) - 1) on (1, s*); P3 s + P4 beyond s* = lambda*/lambda_ofl, continuous with its
    /// slope there; 0 for s <= 1 (Eq. 6).
    pub fn passive(&self, s: f64) -> Force {
        if s <= 1.0 {
            return Force::default();
        }
        let (p1, p2) = (self.p1, self.p2);
        let exponential = |s: f64| {
            let e = (p2 * (s - 1.0)).exp();
            Force { energy: p1 * ((e - 1.0) / p2 - (s - 1.0)), force: p1 * (e - 1.0), slope: p1 * p2 * e }
        };
        let join = (self.lambda_star / self.lambda_ofl).max(1.0);
        if s < join {
            exponential(s)
        } else {
            let at = exponential(join);
            let d = s - join;
            Force {
                energy: at.energy + at.force * d + 0.5 * at.slope * d * d,
                force: at.force + at.slope * d,
                slope: at.slope,
            }
        }
    }

    /// W, dW/dlambda, d2W/dlambda2 (kPa) at stretch lambda and activation a.
    pub fn tension(&self, lambda: f64, activation: f64) -> Force {
        let s = lambda / self.lambda_ofl;
        let (act, pas) = (active(s), self.passive(s));
        Force {
            energy: self.sigma_max * (activation * act.energy + pas.energy),
            force: self.sigma_max / self.lambda_ofl * (activation * act.force + pas.force),
            slope: self.sigma_max / (self.lambda_ofl * self.lambda_ofl) * (activation * act.slope + pas.slope),
        }
    }

    /// d/da of [`Blemker::tension`]: the part that activation multiplies.
    pub fn tension_per_activation(&self, lambda: f64) -> Force {
        let act = active(lambda / self.lambda_ofl);
        Force {
            energy: self.sigma_max * act.energy,
            force: self.sigma_max / self.lambda_ofl * act.force,
            slope: self.sigma_max / (self.lambda_ofl * self.lambda_ofl) * act.slope,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Blemker = Blemker { sigma_max: 300.0, lambda_star: 1.4, lambda_ofl: 1.0, p1: 0.005, p2: 6.6 };

    /// G' = f and f' = slope by central differences on both sides of every join, and what is continuous across the joins.
    #[test]
    fn force_is_the_slope_of_the_energy_and_joins_are_smooth() {
        let law = Blemker { lambda_ofl: 1.1, ..PAPER };
        let h = 1e-5;
        for k in 0..400 {
            let s = 0.303 + 0.005 * k as f64;
            for f in [&active as &dyn Fn(f64) -> Force, &|s| law.passive(s)] {
                let (low, mid, high) = (f(s - h), f(s), f(s + h));
                assert!(((high.energy - low.energy) / (2.0 * h) - mid.force).abs() < 1e-7, "s {s}");
                assert!(((high.force - low.force) / (2.0 * h) - mid.slope).abs() < 1e-4, "s {s}");
            }
        }
        for (join, jump) in [(0.4, 0.0), (0.6, -0.4), (1.4, -0.4), (1.6, 0.0)] {
            let (below, above) = (active(join - 1e-12), active(join + 1e-12));
            assert!((below.energy - above.energy).abs() < 1e-11 && (below.force - above.force).abs() < 1e-10);
            assert!((above.slope - below.slope - jump).abs() < 1e-9, "slope at {join}");
        }
        let join = law.lambda_star / law.lambda_ofl;
        let (below, above) = (law.passive(join - 1e-12), law.passive(join + 1e-12));
        assert!((below.force - above.force).abs() < 1e-12 && (below.slope - above.slope).abs() < 1e-10);
    }
}
