//! Transcendental functions with the same bits on every machine.
//!
//! The platform's own functions (glibc, musl, macOS) differ from each other in the last bit for 3–11 % of
//! arguments, which is enough to send an optimiser elsewhere. These are `libm`'s, in plain Rust.
//! `sqrt` is exact by IEEE 754, so the inherent method may be used everywhere.

pub use libm::{
    acos, asin, atan, atan2, cbrt, ceil, cos, erf, erfc, exp, floor, hypot, log as ln, log2, log10, pow, sin,
    tan,
};

/// Sine and cosine of an angle in radians.
#[must_use]
pub fn sin_cos(angle_rad: f64) -> (f64, f64) {
    libm::sincos(angle_rad)
}

/// The unit vector at `angle_rad`, counter-clockwise from the x axis.
#[must_use]
pub fn unit_vector(angle_rad: f64) -> glam::DVec2 {
    let (sin, cos) = sin_cos(angle_rad);
    glam::DVec2::new(cos, sin)
}
