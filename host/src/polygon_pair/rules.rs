//! Quadrature rules: Gauss-Legendre on the unit interval, and Patterson's nested rules on [-1, 1].
//!
//! # References
//! * T. N. L. Patterson, *The optimum addition of points to quadrature formulae*, Mathematics of
//!   Computation 22, 1968: 3, 7, 15 and 31 points, each set within the next. The numbers here were
//!   computed from that definition in 80 digits.

/// Nodes in (0, 1) with their weights, which sum to 1.
pub(super) type Rule = &'static [(f64, f64)];

/// Gauss-Legendre with two to six points: `GAUSS[n - 2]` has `n`, exact to degree `2 n - 1`.
pub(super) const GAUSS: [Rule; 5] = [
    &[
        (0.211_324_865_405_187_1, 0.5),
        (0.788_675_134_594_812_9, 0.5),
    ],
    &[
        (0.112_701_665_379_258_31, 0.277_777_777_777_777_8),
        (0.5, 0.444_444_444_444_444_4),
        (0.887_298_334_620_741_7, 0.277_777_777_777_777_8),
    ],
    &[
        (0.069_431_844_202_973_71, 0.173_927_422_568_726_92),
        (0.330_009_478_207_571_87, 0.326_072_577_431_273_05),
        (0.669_990_521_792_428_1, 0.326_072_577_431_273_05),
        (0.930_568_155_797_026_3, 0.173_927_422_568_726_92),
    ],
    &[
        (0.046_910_077_030_668_004, 0.118_463_442_528_094_54),
        (0.230_765_344_947_158_45, 0.239_314_335_249_683_24),
        (0.5, 0.284_444_444_444_444_44),
        (0.769_234_655_052_841_5, 0.239_314_335_249_683_24),
        (0.953_089_922_969_332, 0.118_463_442_528_094_54),
    ],
    &[
        (0.033_765_242_898_423_99, 0.085_662_246_189_585_18),
        (0.169_395_306_766_867_73, 0.180_380_786_524_069_3),
        (0.380_690_406_958_401_56, 0.233_956_967_286_345_52),
        (0.619_309_593_041_598_5, 0.233_956_967_286_345_52),
        (0.830_604_693_233_132_2, 0.180_380_786_524_069_3),
        (0.966_234_757_101_576, 0.085_662_246_189_585_18),
    ],
];

/// Points of the finest of Patterson's rules.
pub(super) const PATTERSON_POINTS: usize = 31;

/// Its nodes at and above 0; the rule of level `l` (7, 15 or 31 points for 1, 2 or 3; 3 for 0) takes
/// every `2^(3 - l)`-th of them, and their mirror images.
const NODES: [f64; 16] = [
    0.0,
    0.112_488_943_133_186_62,
    0.223_386_686_428_966_9,
    0.331_135_393_257_976_8,
    0.434_243_749_346_802_54,
    0.531_319_743_644_375_6,
    0.621_102_946_737_226_4,
    0.702_496_206_491_527_1,
    0.774_596_669_241_483_4,
    0.836_725_938_168_868_8,
    0.888_459_232_872_257,
    0.929_654_857_429_740_1,
    0.960_491_268_708_020_3,
    0.981_531_149_553_740_1,
    0.993_831_963_212_755,
    0.999_098_124_967_667_6,
];

/// Weights of the nodes at and above 0, rule by rule; they sum to 2 with the mirror images.
const WEIGHTS: [&[f64]; 4] = [
    &[0.888_888_888_888_888_8, 0.555_555_555_555_555_6],
    &[
        0.450_916_538_658_474_14,
        0.401_397_414_775_962_25,
        0.268_488_089_868_333_45,
        0.104_656_226_026_467_26,
    ],
    &[
        0.225_510_499_798_206_7,
        0.219_156_858_401_587_5,
        0.200_628_529_376_989_02,
        0.171_511_909_136_391_4,
        0.134_415_255_243_784_23,
        0.092_927_195_315_124_54,
        0.051_603_282_997_079_74,
        0.017_001_719_629_940_26,
    ],
    &[
        0.112_755_256_720_768_69,
        0.111_956_873_020_953_46,
        0.109_578_421_055_924_64,
        0.105_669_893_580_234_8,
        0.100_314_278_611_795_58,
        0.093_627_109_981_264_47,
        0.085_755_920_049_990_34,
        0.076_879_620_499_003_53,
        0.067_207_754_295_990_7,
        0.056_979_509_494_123_36,
        0.046_462_893_261_757_99,
        0.035_957_103_307_129_32,
        0.025_807_598_096_176_654,
        0.016_446_049_854_387_81,
        0.008_434_565_739_321_106,
        0.002_544_780_791_561_874_6,
    ],
];

/// The finest level of Patterson's rules.
pub(super) const FINEST: usize = WEIGHTS.len() - 1;

/// The node at `index` of the finest rule, `0..31` from left to right.
pub(super) fn patterson_node(index: usize) -> f64 {
    let middle = PATTERSON_POINTS / 2;
    if index < middle {
        -NODES[middle - index]
    } else {
        NODES[index - middle]
    }
}

/// Indices into the finest rule of the nodes that a level has; the coarser levels' are among them.
pub(super) fn patterson_indices(level: usize) -> impl Iterator<Item = usize> {
    let step = 1 << (FINEST - level);
    (step - 1..PATTERSON_POINTS).step_by(step)
}

/// The integral over [-1, 1] by the rule of a level; `values` are those at the finest rule's nodes.
pub(super) fn patterson_sum(level: usize, values: &[f64; PATTERSON_POINTS]) -> f64 {
    let middle = PATTERSON_POINTS / 2;
    let step = 1 << (FINEST - level);
    let pairs = WEIGHTS[level].iter().enumerate().skip(1);
    pairs.fold(WEIGHTS[level][0] * values[middle], |sum, (k, weight)| {
        sum + weight * (values[middle - k * step] + values[middle + k * step])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_rules_are_exact_up_to_their_degree() {
        for (rule, n) in GAUSS.iter().zip(2..) {
            for degree in 0..2 * n {
                let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(degree)).sum();
                let expected = 1.0 / f64::from(degree + 1);
                assert!((sum - expected).abs() < 4e-16, "{n} {degree} {sum}");
            }
        }
    }

    #[test]
    fn patterson_rules_are_nested_and_exact_up_to_their_degree() {
        for (level, degrees) in [(0, 5), (1, 11), (2, 23), (3, 47)] {
            for degree in 0..=degrees {
                let mut values = [f64::NAN; PATTERSON_POINTS];
                for index in patterson_indices(level) {
                    values[index] = patterson_node(index).powi(degree);
                }
                let expected = f64::from(1 - degree % 2) * 2.0 / f64::from(degree + 1);
                let sum = patterson_sum(level, &values);
                assert!((sum - expected).abs() < 2e-15, "{level} {degree} {sum}");
            }
        }
    }
}
