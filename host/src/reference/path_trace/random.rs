//! Random numbers of the path tracer: SplitMix64, seeded per receiver.
//!
//! # References
//! * G. L. Steele Jr., D. Lea, C. H. Flood, *Fast splittable pseudorandom number generators*,
//!   OOPSLA 2014, figure 17; the constants of the finalizer are D. Stafford's mix 13, as in
//!   S. Vigna's public-domain `splitmix64.c`.

/// 2^64 over the golden ratio, the step of the counter.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub(super) struct Random {
    counter: u64,
}

impl Random {
    /// The stream number `stream` of a seed.
    pub(super) fn new(seed: u64, stream: u64) -> Self {
        Self {
            counter: mix(mix(seed.wrapping_add(STEP)).wrapping_add(stream)),
        }
    }

    fn next(&mut self) -> u64 {
        self.counter = self.counter.wrapping_add(STEP);
        mix(self.counter)
    }

    /// Uniform in [0, 1), a multiple of 2^-53.
    pub(super) fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A choice among numbered things, each with its weight.
#[derive(Clone, Debug)]
pub(super) struct Weights {
    cumulative: Vec<f64>,
}

impl Weights {
    pub(super) fn new(weights: impl IntoIterator<Item = f64>) -> Self {
        let running = weights.into_iter().scan(0.0, |sum, weight| {
            *sum += weight;
            Some(*sum)
        });
        Self {
            cumulative: running.collect(),
        }
    }

    /// Sum of the weights; 0 when there are none.
    pub(super) fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// A number with the probability `weight / total`.
    pub(super) fn choose(&self, random: &mut Random) -> usize {
        let at = random.uniform() * self.total();
        let number = self.cumulative.partition_point(|sum| *sum <= at);
        number.min(self.cumulative.len().saturating_sub(1))
    }
}

/// The finalizer: every bit of the argument reaches every bit of the result.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generator_is_the_published_one() {
        let mut random = Random { counter: 1_234_567 };
        let first: Vec<u64> = (0..3).map(|_| random.next()).collect();
        // Output of splitmix64.c for the seed 1234567.
        let published = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
        ];
        assert_eq!(first, published);
    }

    #[test]
    fn numbers_are_uniform_and_streams_differ() {
        let mut a = Random::new(7, 0);
        let mut b = Random::new(7, 1);
        let count = 100_000;
        let pairs: Vec<(f64, f64)> = (0..count).map(|_| (a.uniform(), b.uniform())).collect();
        assert!(pairs.iter().all(|(a, _)| (0.0..1.0).contains(a)));

        // Variance of a uniform number is 1/12, of a product of two independent centred ones 1/144.
        let n = f64::from(count);
        let mean = pairs.iter().map(|(a, _)| a - 0.5).sum::<f64>() / n;
        let covariance = pairs
            .iter()
            .map(|(a, b)| (a - 0.5) * (b - 0.5))
            .sum::<f64>()
            / n;
        assert!(mean.abs() < 4.0 / (12.0 * n).sqrt(), "{mean}");
        assert!(covariance.abs() < 4.0 / (144.0 * n).sqrt(), "{covariance}");
    }

    #[test]
    fn things_are_chosen_as_often_as_they_weigh() {
        let weights = Weights::new([1.0, 0.0, 3.0]);
        let mut random = Random::new(3, 0);
        let mut counts = [0.0; 3];
        for _ in 0..40_000 {
            counts[weights.choose(&mut random)] += 1.0;
        }
        // Binomial with p = 1/4: standard deviation 87.
        assert!((counts[0] - 10_000.0f64).abs() < 350.0, "{counts:?}");
        assert_eq!(counts[1], 0.0);
    }
}
