//! Four points side by side: one operation serves them all, and vectorises.
//!
//! Lanes never mix, and every operation is the one of IEEE 754 on each of them, so the bits are the
//! same on targets with vectors and without.

use core::ops::{Add, Div, Mul, Neg, Sub};

use glam::Vec3;

/// One number for each of four points.
#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
pub(super) struct Numbers(pub [f32; 4]);

/// One vector for each of four points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vectors {
    pub x: Numbers,
    pub y: Numbers,
    pub z: Numbers,
}

/// A set of lanes, one bit for each.
pub(super) type Mask = u8;

/// Every lane.
pub(super) const ALL: Mask = 0b1111;

impl Numbers {
    pub const ZERO: Self = Self::all(0.0);

    /// The same number in every lane.
    pub const fn all(value: f32) -> Self {
        Self([value; 4])
    }

    #[inline(always)]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        let [a, b, c, d] = self.0;
        Self([f(a), f(b), f(c), f(d)])
    }

    #[inline(always)]
    pub fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let ([a, b, c, d], [e, g, h, i]) = (self.0, other.0);
        Self([f(a, e), f(b, g), f(c, h), f(d, i)])
    }

    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn which(self, other: Self, f: impl Fn(f32, f32) -> bool) -> Mask {
        let ([a, b, c, d], [e, g, h, i]) = (self.0, other.0);
        u8::from(f(a, e)) | u8::from(f(b, g)) << 1 | u8::from(f(c, h)) << 2 | u8::from(f(d, i)) << 3
    }

    /// The lanes in which this is larger.
    #[inline(always)]
    pub fn above(self, other: Self) -> Mask {
        self.which(other, |a, b| a > b)
    }

    /// The lanes in which this is not smaller.
    #[inline(always)]
    pub fn at_least(self, other: Self) -> Mask {
        self.which(other, |a, b| a >= b)
    }

    /// Another number where `sign` is below zero.
    #[inline(always)]
    pub fn if_negative(self, sign: Self, other: Self) -> Self {
        let [[a, b, c, d], [e, f, g, h], [i, j, k, l]] = [sign.0, other.0, self.0];
        let pick = |sign, other, own| if sign < 0.0 { other } else { own };
        Self([pick(a, e, i), pick(b, f, j), pick(c, g, k), pick(d, h, l)])
    }

    /// Zero outside of some lanes.
    pub fn within(self, lanes: Mask) -> Self {
        let [a, b, c, d] = self.0;
        let of = |lane: u8, value| if lanes >> lane & 1 == 1 { value } else { 0.0 };
        Self([of(0, a), of(1, b), of(2, c), of(3, d)])
    }
}

macro_rules! by_lane {
    ($operation:ident, $name:ident, $sign:tt) => {
        impl $operation for Numbers {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                self.zip(other, |a, b| a $sign b)
            }
        }
    };
}

by_lane!(Add, add, +);
by_lane!(Sub, sub, -);
by_lane!(Mul, mul, *);
by_lane!(Div, div, /);

impl Neg for Numbers {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl Vectors {
    /// The same vector in every lane.
    #[inline(always)]
    pub const fn all(v: Vec3) -> Self {
        Self {
            x: Numbers::all(v.x),
            y: Numbers::all(v.y),
            z: Numbers::all(v.z),
        }
    }

    /// A vector for each lane.
    pub fn new([a, b, c, d]: [Vec3; 4]) -> Self {
        Self {
            x: Numbers([a.x, b.x, c.x, d.x]),
            y: Numbers([a.y, b.y, c.y, d.y]),
            z: Numbers([a.z, b.z, c.z, d.z]),
        }
    }

    /// The vector of each lane.
    pub fn lanes(self) -> [Vec3; 4] {
        let [[a, b, c, d], [e, f, g, h], [i, j, k, l]] = [self.x.0, self.y.0, self.z.0];
        [[a, e, i], [b, f, j], [c, g, k], [d, h, l]].map(Vec3::from_array)
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> Numbers {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - other.y * self.z,
            y: self.z * other.x - other.z * self.x,
            z: self.x * other.y - other.x * self.y,
        }
    }

    /// Largest absolute coordinate.
    pub fn magnitude(self) -> Numbers {
        let [x, y, z] = [self.x, self.y, self.z].map(|n| n.map(f32::abs));
        x.max(y).max(z)
    }
}

impl Add for Vectors {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            x: self.x + other.x,
            y: self.y + other.y,
            z: self.z + other.z,
        }
    }
}

impl Sub for Vectors {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            x: self.x - other.x,
            y: self.y - other.y,
            z: self.z - other.z,
        }
    }
}

impl Mul<Numbers> for Vectors {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: Numbers) -> Self {
        Self {
            x: self.x * factor,
            y: self.y * factor,
            z: self.z * factor,
        }
    }
}
