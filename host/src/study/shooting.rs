//! The published loop once more, in `f64`, with what others changed in it.
//!
//! As [`relume::refine`] without row storage: the patch with the most unshot power shoots all it holds.
//! `Overshooting` also sends what the patch will get later, `rho_i a` with the ambient term
//! `a = U / ((1 - rho) sum A)`, and owes it (Feda and Purgathofer 1992). `Half` keeps all state in
//! 16-bit floats, as a GPU of its time or a small device would.

use super::system::{Field, System, exitance};

/// What is done differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// Future light is sent in advance.
    Overshooting,
    /// State is rounded to 16-bit floats.
    Half,
}

/// Channels of all lights, `3 light + channel`.
type Values = Vec<f64>;

/// State of the loop.
struct Loop<'a> {
    system: &'a System,
    variant: Variant,
    irradiance: Vec<Values>,
    unshot: Vec<Values>,
    /// Mean reflectance of each patch.
    reflectances: Vec<[f64; 3]>,
}

/// Irradiance after so many shots.
#[must_use]
pub fn shoot(system: &System, variant: Variant, shots: u32) -> Field {
    let mut state = Loop::new(system, variant);
    for _ in 0..shots {
        let Some(patch) = state.brightest() else {
            break;
        };
        state.shoot(patch);
    }
    let by_light = |values: &Values| {
        let triples = values.chunks(3);
        triples.map(|rgb| [rgb[0], rgb[1], rgb[2]]).collect()
    };
    state.irradiance.iter().map(by_light).collect()
}

impl<'a> Loop<'a> {
    fn new(system: &'a System, variant: Variant) -> Self {
        let mesh = system.mesh.view();
        let emitted = |patch| (0..system.lights).flat_map(move |m| exitance(&mesh, patch, m));
        let mut reflectances = vec![[0.0; 3]; mesh.patches.len()];
        for element in mesh.elements {
            let patch = element.patch as usize;
            let share = f64::from(element.area / mesh.patches[patch].area);
            let rho = element.reflectance.to_array();
            for (mean, rho) in reflectances[patch].iter_mut().zip(rho) {
                *mean += share * f64::from(rho);
            }
        }
        Self {
            system,
            variant,
            irradiance: vec![vec![0.0; 3 * system.lights as usize]; mesh.elements.len()],
            unshot: (0..mesh.patches.len() as u32)
                .map(|patch| emitted(patch).collect())
                .collect(),
            reflectances,
        }
    }

    fn area(&self, patch: usize) -> f64 {
        self.system.mesh.patches[patch].area.into()
    }

    fn brightest(&self) -> Option<usize> {
        let power = |patch: &usize| {
            let values = self.unshot[*patch].iter();
            values.map(|value| value.abs()).sum::<f64>() * self.area(*patch)
        };
        let patches = (0..self.unshot.len()).filter(|patch| power(patch) > 0.0);
        patches.max_by(|a, b| power(a).total_cmp(&power(b)))
    }

    fn shoot(&mut self, patch: usize) {
        let mut sent = self.unshot[patch].clone();
        let mut owed = vec![0.0; sent.len()];
        if self.variant == Variant::Overshooting {
            owed = self.future(patch);
            sent.iter_mut()
                .zip(&owed)
                .for_each(|(sent, more)| *sent += more);
        }
        self.unshot[patch] = owed.iter().map(|owed| -owed).collect();

        let round = self.rounding();
        let row = self.system.row(patch as u32);
        for ((factor, element), irradiance) in row
            .iter()
            .zip(&self.system.mesh.elements)
            .zip(&mut self.irradiance)
        {
            if *factor == 0.0 {
                continue;
            }
            let home = element.patch as usize;
            let share = f64::from(element.area / self.system.mesh.patches[home].area);
            let rho = element.reflectance.to_array();
            for (lane, sent) in sent.iter().enumerate() {
                let arrived = f64::from(*factor) * sent;
                irradiance[lane] = round(irradiance[lane] + arrived);
                let unshot = &mut self.unshot[home][lane];
                *unshot = round(*unshot + share * f64::from(rho[lane % 3]) * arrived);
            }
        }
    }

    /// What a patch will reflect of all that is still unshot, on average.
    fn future(&self, patch: usize) -> Values {
        let areas: f64 = (0..self.unshot.len()).map(|p| self.area(p)).sum();
        let mut ambient = vec![0.0; self.unshot[patch].len()];
        let mut mean = [0.0; 3];
        for (number, unshot) in self.unshot.iter().enumerate() {
            let share = self.area(number) / areas;
            ambient
                .iter_mut()
                .zip(unshot)
                .for_each(|(a, u)| *a += share * u);
            let rho = self.reflectances[number];
            mean.iter_mut()
                .zip(rho)
                .for_each(|(mean, rho)| *mean += share * rho);
        }
        let lanes = ambient.iter().enumerate();
        lanes
            .map(|(lane, ambient)| {
                let channel = lane % 3;
                let rho = self.reflectances[patch][channel];
                (rho * ambient / (1.0 - mean[channel])).max(0.0)
            })
            .collect()
    }

    fn rounding(&self) -> fn(f64) -> f64 {
        match self.variant {
            Variant::Overshooting => |value| value,
            Variant::Half => half,
        }
    }
}

/// The nearest IEEE 754 binary16 value: 11 bits of precision, steps of at least `2^-24`.
fn half(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    let exponent = value.abs().log2().floor().max(-14.0);
    let step = (exponent - 10.0).exp2();
    (value / step).round_ties_even() * step
}

#[cfg(test)]
mod tests {
    use super::half;

    #[test]
    fn half_floats_round_as_the_standard_says() {
        for (value, expected) in [
            (1.0, 1.0),
            (1.0 + 1.0 / 2048.0, 1.0),
            (1.0 + 3.0 / 2048.0, 1.0 + 4.0 / 2048.0),
            (2049.0, 2048.0),
            (-0.1, -0.099_975_585_937_5),
            (2.0_f64.powi(-24), 2.0_f64.powi(-24)),
            (2.0_f64.powi(-26), 0.0),
        ] {
            assert_eq!(half(value), expected, "{value}");
        }
    }
}
