//! Numbers that look random and are the same every time.

/// A number in [0, 1) for every seed.
#[must_use]
pub fn unit(seed: u64) -> f32 {
    fraction(bits(seed))
}

/// Parts of 2^32, as a number in [0, 1): the top 24 bits.
#[must_use]
pub fn fraction(parts: u32) -> f32 {
    (parts >> 8) as f32 / (1_u32 << 24) as f32
}

/// `1/g, 1/g^2, 1/g^3, 1/g^4` with `g^5 = g + 1`, in parts of 2^32: multiples of them fill four dimensions
/// evenly (Roberts 2018, R4).
pub const STEPS: [u32; 4] = [3_679_390_609, 3_152_041_523, 2_700_274_806, 2_313_257_605];

/// Bits for every seed: SplitMix64 (Steele, Lea and Flood 2014), the top ones.
#[must_use]
pub fn bits(seed: u64) -> u32 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fill_the_unit_interval_evenly() {
        let count = 10_000;
        let numbers: Vec<f32> = (0..count).map(unit).collect();
        assert!(numbers.iter().all(|n| (0.0..1.0).contains(n)));
        let mean: f32 = numbers.iter().sum::<f32>() / count as f32;
        // Four standard errors of a uniform mean.
        assert!(
            (mean - 0.5).abs() < 4.0 * (1.0 / 12.0 / count as f32).sqrt(),
            "{mean}"
        );
    }
}
